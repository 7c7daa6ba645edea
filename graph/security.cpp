#include "graph/security.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

namespace cosegraph::graph {
namespace {

namespace fs = std::filesystem;

constexpr std::time_t kDay = 24 * 60 * 60;

std::string element(std::string_view name, const std::string& content) {
  return "<" + std::string(name) + ">" + content + "</" + std::string(name) + ">";
}

// On a line each: signed text goes through software for mail, which does not expect long lines.
std::string elements(std::string_view name, const std::vector<std::string>& contents) {
  std::string result;
  for (const auto& content : contents) result += "\n" + element(name, content);
  return result;
}

std::string domains_text(const GraphDescription& graph) {
  return element("domains", element("id", std::to_string(graph.dds.domain)));
}

// A run of a graph has the partition "GRAPH" or "GRAPH.INSTANCE".
std::string topics_text(const GraphDescription& graph, const std::vector<std::string>& topics) {
  return element("topics", elements("topic", topics)) +
         element("partitions", elements("partition", {graph.graph, graph.graph + ".*"}));
}

std::string date_text(std::time_t time) {
  std::tm utc{};
  ::gmtime_r(&time, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
  return text;
}

std::string document(std::string_view schema, const std::string& content) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
         "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
         "xsi:noNamespaceSchemaLocation=\"http://www.omg.org/spec/DDS-SECURITY/20170901/" +
         std::string(schema) + "\">\n" + content + "\n</dds>\n";
}

// Why the file cannot be read, or "".
std::string unreadable(const fs::path& file) {
  if (::access(file.c_str(), R_OK) == 0) {
    std::error_code ignored;
    return fs::is_regular_file(file, ignored) ? "" : file.string() + " is not a plain file";
  }
  if (errno == ENOENT) return "there is no " + file.string();
  return file.string() + " cannot be read: " + std::strerror(errno);
}

bool is_open_to_others(const fs::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 && (status.st_mode & (S_IRWXG | S_IRWXO)) != 0;
}

std::string without_validity(std::string text) {
  const std::size_t from = text.find("<validity>");
  const std::size_t to = text.find("</validity>");
  if (from != std::string::npos && to != std::string::npos && from < to)
    text.erase(from, to - from);
  return text;
}

// Whether a signed document is this one, validity aside. It is text, with the line ends of mail.
bool holds(const fs::path& file, const std::string& document) {
  std::ifstream stream(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  std::erase(text, '\r');
  return without_validity(std::move(text)).find(without_validity(document)) != std::string::npos;
}

bool runs_here(const GraphDescription& graph, const StageNode& stage) {
  return std::ranges::any_of(hosts_of(stage), [&](const std::string& name) {
    const auto host = std::ranges::find(graph.hosts, name, &Host::name);
    return name.empty() || (host != graph.hosts.end() && is_loopback(host->address));
  });
}

std::vector<Identity> identities_here(const GraphDescription& graph) {
  std::vector<Identity> result = identities_of(graph);
  std::erase_if(result, [&](const Identity& identity) {
    return identity.role == Role::stage && !runs_here(graph, *graph.stage(identity.stage));
  });
  const bool any_stage = !result.empty() && result.front().role == Role::stage;
  return any_stage ? result : std::vector<Identity>{};
}

}  // namespace

fs::path key_folder::of(const Identity& identity) {
  if (identity.role == Role::stage) return fs::path("stages") / identity.stage;
  return std::string(to_name(identity.role));
}

KeyFiles key_files(const GraphDescription& graph, const Identity& identity) {
  const fs::path folder =
      fs::absolute(fs::path(graph.file).parent_path() / graph.dds.security).lexically_normal();
  const fs::path own = folder / key_folder::of(identity);
  return {.identity_ca = folder / key_folder::kIdentityCa,
          .permissions_ca = folder / key_folder::kPermissionsCa,
          .governance = folder / key_folder::kGovernance,
          .certificate = own / key_folder::kCertificate,
          .key = own / key_folder::kKey,
          .permissions = own / key_folder::kPermissions};
}

std::string Subject::to_text() const {
  return "CN=" + common_name + ",O=" + organisation;
}

Subject subject_of(const GraphDescription& graph, const Identity& identity) {
  const std::string role(to_name(identity.role));
  return {.common_name = identity.role == Role::stage ? role + "." + identity.stage : role,
          .organisation = graph.graph};
}

// Payloads are encrypted once, with a key that only readers of the topic get; what goes with them
// is signed, so that nobody else can acknowledge or withdraw samples.
std::string governance_text(const GraphDescription& graph) {
  const std::string topic = "\n" + element("topic_expression", "*") + "\n" +
                            element("enable_discovery_protection", "true") + "\n" +
                            element("enable_liveliness_protection", "true") + "\n" +
                            element("enable_read_access_control", "true") + "\n" +
                            element("enable_write_access_control", "true") + "\n" +
                            element("metadata_protection_kind", "SIGN") + "\n" +
                            element("data_protection_kind", "ENCRYPT") + "\n";
  const std::string rule = "\n" + domains_text(graph) + "\n" +
                           element("allow_unauthenticated_participants", "false") + "\n" +
                           element("enable_join_access_control", "true") + "\n" +
                           element("discovery_protection_kind", "ENCRYPT") + "\n" +
                           element("liveliness_protection_kind", "ENCRYPT") + "\n" +
                           element("rtps_protection_kind", "NONE") + "\n" +
                           element("topic_access_rules", element("topic_rule", topic)) + "\n";
  return document("omg_shared_ca_governance.xsd",
                  element("domain_access_rules", element("domain_rule", rule)));
}

// Fast DDS takes the times for local ones: a day more on both sides keeps time zones out of it. A
// participant's certificate, whose times are exact, ends its rights.
std::string permissions_text(const GraphDescription& graph, const Catalog& catalog,
                             const Identity& identity, const Validity& validity) {
  const Subject subject = subject_of(graph, identity);
  const TopicRights rights = rights_of(graph, catalog, identity);
  const std::string grant =
      element("subject_name", subject.to_text()) + "\n" +
      element("validity", element("not_before", date_text(validity.from - kDay)) +
                              element("not_after", date_text(validity.until + kDay))) +
      "\n" +
      element("allow_rule", domains_text(graph) +
                                element("publish", topics_text(graph, rights.writes)) +
                                element("subscribe", topics_text(graph, rights.reads))) +
      "\n" + element("default", "DENY");
  return document("omg_shared_ca_permissions.xsd", "<permissions><grant name=\"" +
                                                       subject.common_name + "\">\n" + grant +
                                                       "\n</grant></permissions>");
}

std::vector<std::string> key_faults(const KeyFiles& files) {
  std::vector<std::string> faults;
  for (const auto* file : {&files.identity_ca, &files.permissions_ca, &files.governance,
                           &files.certificate, &files.key, &files.permissions})
    if (std::string fault = unreadable(*file); !fault.empty()) faults.push_back(std::move(fault));
  if (is_open_to_others(files.key))
    faults.push_back(files.key.string() + " may be read by others; chmod 600 it");
  return faults;
}

std::vector<Fault> check_keys(const GraphDescription& graph, const Catalog& catalog) {
  std::vector<std::string> messages;
  const auto add = [&](const std::string& message) {
    if (std::ranges::find(messages, message) == messages.end()) messages.push_back(message);
  };
  if (graph.dds.discovery == Discovery::server)
    add("a discovery server has no keys, so nobody would be found; use multicast or peers");
  const fs::path folder = key_files(graph, {}).governance.parent_path();
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) {
    add("there is no folder " + folder.string() + "; 'cosegraph keys init' makes it");
  } else {
    const auto check_document = [&](const fs::path& file, const std::string& wanted) {
      if (unreadable(file).empty() && !holds(file, wanted))
        add(file.string() +
            " is not for this graph as it is now; issue it again with 'cosegraph keys issue'");
    };
    check_document(key_files(graph, {}).governance, governance_text(graph));
    for (const auto& identity : identities_here(graph)) {
      const KeyFiles files = key_files(graph, identity);
      if (!fs::exists(files.certificate.parent_path(), ignored)) {
        add(to_text(identity) + " has no keys in " + folder.string() +
            "; 'cosegraph keys issue' makes them");
        continue;
      }
      for (const auto& message : key_faults(files)) add(message);
      check_document(files.permissions, permissions_text(graph, catalog, identity, {}));
      // Certificate and permissions travel in one message, beside 2 kB of other things (see
      // dds.cpp).
      constexpr std::uintmax_t kMost = 6000;
      std::uintmax_t size = 0;
      for (const auto* file : {&files.certificate, &files.permissions})
        if (fs::exists(*file, ignored)) size += fs::file_size(*file, ignored);
      if (graph.hosts.size() > 1 && size > kMost)
        add("certificate and permissions of " + to_text(identity) + " have " +
            std::to_string(size) + " bytes, more than the " + std::to_string(kMost) +
            " by which it can prove itself to other hosts; give it fewer inputs, or shorter names");
    }
  }
  std::vector<Fault> faults;
  for (const auto& message : messages)
    faults.push_back({graph.file, graph.dds.security_mark, "security: " + message});
  return faults;
}

}  // namespace cosegraph::graph
