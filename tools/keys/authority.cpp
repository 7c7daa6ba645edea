#include "tools/keys/authority.hpp"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <initializer_list>
#include <utility>

#include "graph/openssl.hpp"

namespace cosegraph::keys {
namespace {

using openssl::Bio;
using openssl::Certificate;
using openssl::Free;
using openssl::Key;
using openssl::Signed;
using openssl::text_of;
using Number = std::unique_ptr<BIGNUM, Free<BN_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Free<X509_EXTENSION_free>>;

// Throws with OpenSSL's reason unless `fine`.
void require(bool fine, const std::string& what) {
  if (fine) return;
  char reason[256];
  ERR_error_string_n(ERR_get_error(), reason, sizeof reason);
  ERR_clear_error();
  throw Error("cannot " + what + ": " + reason);
}

Bio memory() {
  return Bio(BIO_new(BIO_s_mem()));
}

Bio reader(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

Certificate certificate_of(const Credential& credential) {
  Certificate result(
      PEM_read_bio_X509(reader(credential.certificate).get(), nullptr, nullptr, nullptr));
  if (!result) throw InputError("the authority's certificate cannot be read");
  return result;
}

Key key_of(const Credential& credential) {
  Key result(PEM_read_bio_PrivateKey(reader(credential.key).get(), nullptr, nullptr, nullptr));
  if (!result) throw InputError("the authority's key cannot be read");
  return result;
}

Credential to_pem(const Certificate& certificate, const Key& key) {
  const Bio certificate_text = memory();
  const Bio key_text = memory();
  require(PEM_write_bio_X509(certificate_text.get(), certificate.get()) == 1 &&
              PEM_write_bio_PKCS8PrivateKey(key_text.get(), key.get(), nullptr, nullptr, 0, nullptr,
                                            nullptr) == 1,
          "write a certificate");
  return {.certificate = text_of(certificate_text), .key = text_of(key_text)};
}

// In this order the name reads "CN=..,O=.." as RFC 2253 has it.
void set_subject(X509* certificate, const graph::Subject& subject) {
  X509_NAME* name = X509_get_subject_name(certificate);
  for (const auto& [field, value] :
       {std::pair{"O", &subject.organisation}, std::pair{"CN", &subject.common_name}}) {
    if (value->size() > 64)
      throw InputError("'" + *value + "' is too long for a certificate: 64 characters fit");
    require(X509_NAME_add_entry_by_txt(name, field, MBSTRING_UTF8,
                                       reinterpret_cast<const unsigned char*>(value->c_str()), -1,
                                       -1, 0) == 1,
            "set the subject " + *value);
  }
}

void set_serial(X509* certificate) {
  const Number number(BN_new());
  require(BN_rand(number.get(), 127, BN_RAND_TOP_ANY, BN_RAND_BOTTOM_ANY) == 1 &&
              BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)) != nullptr,
          "choose a serial number");
}

using Extensions = std::initializer_list<std::pair<int, const char*>>;

void set_extensions(X509* certificate, X509* issuer, const Extensions& extensions) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  for (const auto& [id, value] : extensions) {
    const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, id, value));
    require(extension && X509_add_ext(certificate, extension.get(), -1) == 1,
            "extend a certificate");
  }
}

// `issuer`: whose key signs; none: its own.
Credential make(const graph::Subject& subject, const graph::Validity& validity,
                const Credential* issuer, const Extensions& extensions) {
  const Key key(EVP_EC_gen("P-256"));
  require(key != nullptr, "make a key");
  const Certificate certificate(X509_new());
  require(certificate != nullptr && X509_set_version(certificate.get(), X509_VERSION_3) == 1,
          "make a certificate");
  set_serial(certificate.get());
  set_subject(certificate.get(), subject);
  require(ASN1_TIME_set(X509_getm_notBefore(certificate.get()), validity.from) != nullptr &&
              ASN1_TIME_set(X509_getm_notAfter(certificate.get()), validity.until) != nullptr &&
              X509_set_pubkey(certificate.get(), key.get()) == 1,
          "make a certificate");
  const Certificate issuing = issuer == nullptr ? nullptr : certificate_of(*issuer);
  X509* by = issuing ? issuing.get() : certificate.get();
  require(X509_set_issuer_name(certificate.get(), X509_get_subject_name(by)) == 1,
          "make a certificate");
  set_extensions(certificate.get(), by, extensions);
  const Key signing = issuer == nullptr ? nullptr : key_of(*issuer);
  require(X509_sign(certificate.get(), signing ? signing.get() : key.get(), EVP_sha256()) > 0,
          "sign a certificate");
  return to_pem(certificate, key);
}

}  // namespace

// It signs documents as well, so "digitalSignature".
Credential make_authority(const graph::Subject& subject, const graph::Validity& validity) {
  return make(subject, validity, nullptr,
              {{NID_basic_constraints, "critical,CA:TRUE,pathlen:0"},
               {NID_key_usage, "critical,keyCertSign,cRLSign,digitalSignature"},
               {NID_subject_key_identifier, "hash"}});
}

Credential issue(const Credential& authority, const graph::Subject& subject,
                 const graph::Validity& validity) {
  return make(subject, validity, &authority,
              {{NID_basic_constraints, "critical,CA:FALSE"},
               {NID_key_usage, "critical,digitalSignature"},
               {NID_subject_key_identifier, "hash"},
               {NID_authority_key_identifier, "keyid"}});
}

std::string sign(const Credential& authority, const std::string& text) {
  const Certificate certificate = certificate_of(authority);
  const Key key = key_of(authority);
  const Bio in = reader(text);
  const Bio out = memory();
  constexpr int kFlags = PKCS7_DETACHED | PKCS7_TEXT | PKCS7_STREAM;
  const Signed document(PKCS7_sign(certificate.get(), key.get(), nullptr, in.get(), kFlags));
  require(document && SMIME_write_PKCS7(out.get(), document.get(), in.get(), kFlags) == 1,
          "sign a document");
  return text_of(out);
}

}  // namespace cosegraph::keys
