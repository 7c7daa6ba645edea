#include "graph/credentials.hpp"

#include <openssl/err.h>
#include <openssl/pem.h>

#include "graph/openssl.hpp"

namespace cosegraph::graph {
namespace {

namespace fs = std::filesystem;

using openssl::Bio;
using openssl::Certificate;
using openssl::Free;
using openssl::Key;
using openssl::Signed;
using openssl::text_of;
using Store = std::unique_ptr<X509_STORE, Free<X509_STORE_free>>;
using StoreContext = std::unique_ptr<X509_STORE_CTX, Free<X509_STORE_CTX_free>>;

Bio open(const fs::path& file) {
  return Bio(BIO_new_file(file.c_str(), "r"));
}

Certificate read_certificate(const fs::path& file) {
  const Bio in = open(file);
  Certificate certificate(in ? PEM_read_bio_X509(in.get(), nullptr, nullptr, nullptr) : nullptr);
  if (!certificate) throw InputError(file.string() + " holds no certificate");
  return certificate;
}

Store read_authority(const fs::path& file) {
  Store store(X509_STORE_new());
  X509_STORE_add_cert(store.get(), read_certificate(file).get());
  return store;
}

std::string text_of(const ASN1_TIME* time) {
  const Bio out(BIO_new(BIO_s_mem()));
  ASN1_TIME_print(out.get(), time);
  return text_of(out);
}

std::string subject_of(const X509* certificate) {
  const Bio out(BIO_new(BIO_s_mem()));
  X509_NAME_print_ex(out.get(), X509_get_subject_name(certificate), 0, XN_FLAG_RFC2253);
  return text_of(out);
}

void require_certificate(const KeyFiles& files, const std::string& subject) {
  const std::string name = files.certificate.string();
  const Certificate certificate = read_certificate(files.certificate);
  const std::string holder = subject_of(certificate.get());
  if (holder != subject)
    throw InputError(name + " is the certificate of " + holder + ", not of " + subject);
  const Store store = read_authority(files.identity_ca);
  const StoreContext context(X509_STORE_CTX_new());
  X509_STORE_CTX_init(context.get(), store.get(), certificate.get(), nullptr);
  if (X509_verify_cert(context.get()) == 1) return;
  switch (const int error = X509_STORE_CTX_get_error(context.get())) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      throw InputError(name + " has expired on " + text_of(X509_get0_notAfter(certificate.get())) +
                       "; 'cosegraph keys issue' makes a new one");
    case X509_V_ERR_CERT_NOT_YET_VALID:
      throw InputError(name + " is valid from " + text_of(X509_get0_notBefore(certificate.get())) +
                       " on; is this machine's clock right?");
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:
      throw InputError(name + " was not issued by the authority of " + files.identity_ca.string());
    default:
      throw InputError(name + ": " + X509_verify_cert_error_string(error));
  }
}

void require_key(const KeyFiles& files) {
  const Bio in = open(files.key);
  const Key key(in ? PEM_read_bio_PrivateKey(in.get(), nullptr, nullptr, nullptr) : nullptr);
  if (!key) throw InputError(files.key.string() + " holds no private key");
  if (X509_check_private_key(read_certificate(files.certificate).get(), key.get()) != 1)
    throw InputError(files.key.string() + " does not belong to " + files.certificate.string());
}

// The document's text.
std::string require_signed(const fs::path& document, const fs::path& authority) {
  const Bio in = open(document);
  BIO* content = nullptr;
  const Signed parsed(in ? SMIME_read_PKCS7(in.get(), &content) : nullptr);
  const Bio owned(content);
  const Store store = read_authority(authority);
  const Bio out(BIO_new(BIO_s_mem()));
  if (!parsed ||
      PKCS7_verify(parsed.get(), nullptr, store.get(), content, out.get(), PKCS7_TEXT) != 1)
    throw InputError(document.string() + " is not signed by the authority of " +
                     authority.string());
  return text_of(out);
}

void require_documents(const KeyFiles& files, const std::string& subject) {
  require_signed(files.governance, files.permissions_ca);
  const std::string permissions = require_signed(files.permissions, files.permissions_ca);
  if (permissions.find("<subject_name>" + subject + "</subject_name>") == std::string::npos)
    throw InputError(files.permissions.string() + " holds no permissions of " + subject);
}

}  // namespace

void require_keys(const GraphDescription& graph, const Identity& identity) {
  if (graph.dds.security.empty()) return;
  const KeyFiles files = key_files(graph, identity);
  std::vector<Fault> faults;
  const auto add = [&](const std::string& message) {
    faults.push_back({graph.file, graph.dds.security_mark, "security: " + message});
  };
  for (const auto& message : key_faults(files)) add(message);
  if (faults.empty()) {
    try {
      const std::string subject = subject_of(graph, identity).to_text();
      require_certificate(files, subject);
      require_key(files);
      require_documents(files, subject);
    } catch (const InputError& error) {
      add(error.what());
    }
    ERR_clear_error();
  }
  if (!faults.empty()) throw GraphError(std::move(faults));
}

}  // namespace cosegraph::graph
