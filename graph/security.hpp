// DDS-Security of a graph: which files a participant needs, and what stands in them.
//
// Keys are made by `cosegraph keys` into a folder, which the graph file names (dds.security):
//
//   identity_ca.pem, permissions_ca.pem   public: whose signatures count
//   governance.p7s                        signed: everything is authenticated and encrypted
//   stages/NAME/, observer/, agent/       of one participant:
//     cert.pem, key.pem, permissions.p7s  who it is, and which topics it may use (topics.hpp)
//   ca/                                   the authorities' keys; not needed to run a graph
//
// The authority for permissions is another one than that for identities: whoever has a certificate
// could sign permissions for himself otherwise.
#pragma once

#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "graph/topics.hpp"

namespace cosegraph::graph {

// Names of files and folders in a key folder.
namespace key_folder {
constexpr const char* kIdentityCa = "identity_ca.pem";
constexpr const char* kPermissionsCa = "permissions_ca.pem";
constexpr const char* kGovernance = "governance.p7s";
constexpr const char* kCertificate = "cert.pem";
constexpr const char* kKey = "key.pem";
constexpr const char* kPermissions = "permissions.p7s";

// The folder of one participant, relative to the key folder.
std::filesystem::path of(const Identity& identity);
}  // namespace key_folder

// Absolute paths of what a participant needs.
struct KeyFiles {
  std::filesystem::path identity_ca;
  std::filesystem::path permissions_ca;
  std::filesystem::path governance;
  std::filesystem::path certificate;
  std::filesystem::path key;
  std::filesystem::path permissions;
};

// Expects a graph with dds.security.
KeyFiles key_files(const GraphDescription& graph, const Identity& identity);

// Subject of a participant's certificate: "CN=stage.cpc,O=segment".
struct Subject {
  std::string common_name;
  std::string organisation;

  std::string to_text() const;  // as RFC 2253 has it
};

Subject subject_of(const GraphDescription& graph, const Identity& identity);

// Seconds since 1970.
struct Validity {
  std::time_t from = 0;
  std::time_t until = 0;
};

// The documents, before they are signed.
std::string governance_text(const GraphDescription& graph);
std::string permissions_text(const GraphDescription& graph, const Catalog& catalog,
                             const Identity& identity, const Validity& validity);

// What is wrong with files that a participant needs, in words that name each: missing, unreadable,
// a private key that others may read. Whether signatures are right shows when they are used.
std::vector<std::string> key_faults(const KeyFiles& files);

// What is wrong with the keys of a graph with dds.security, for all that may run on this machine
// (stages without a host, or with one whose address is the loopback; if there is one, observer and
// agent too): key_faults(), and documents for other topics or another domain than the graph has
// now.
std::vector<Fault> check_keys(const GraphDescription& graph, const Catalog& catalog);

}  // namespace cosegraph::graph
