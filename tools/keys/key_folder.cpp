#include "tools/keys/key_folder.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "io/file.hpp"
#include "tools/keys/authority.hpp"

namespace cosegraph::keys {
namespace {

namespace fs = std::filesystem;
using graph::Identity;
using graph::Validity;

constexpr std::time_t kHour = 3600;
constexpr std::time_t kDay = 24 * kHour;
constexpr int kMostDays = 3650;
constexpr unsigned kOnlyOwner = 0600;
constexpr const char* kAuthorities = "ca";
constexpr const char* kIdentityKey = "identity_key.pem";
constexpr const char* kPermissionsKey = "permissions_key.pem";

[[noreturn]] void fail(const fs::path& path, const char* action) {
  throw InputError(path.string() + ": cannot " + action + ": " + std::strerror(errno));
}

void make_folder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) fail(folder, "make");
}

// A folder beside `place`, on the same file system; gone with the object unless it was moved.
class NewFolder {
 public:
  explicit NewFolder(const fs::path& place) : place_(place) {
    std::string pattern =
        (place.parent_path() / ("." + place.filename().string() + ".XXXXXX")).string();
    if (::mkdtemp(pattern.data()) == nullptr) fail(place, "make");
    path_ = pattern;
  }
  ~NewFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;

  const fs::path& path() const { return path_; }

  // What was there goes with this object.
  void put_in_place() {
    const bool exists = fs::exists(place_);
    if (::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, place_.c_str(),
                    exists ? RENAME_EXCHANGE : RENAME_NOREPLACE) != 0)
      fail(place_, "make");
  }

 private:
  fs::path place_;
  fs::path path_;
};

struct Authorities {
  Credential identity;
  Credential permissions;
};

Authorities make_authorities(const graph::GraphDescription& graph, const Validity& validity) {
  const Validity longer{validity.from, std::max(validity.until, validity.from + kMostDays * kDay)};
  return {.identity = make_authority({"identity authority", graph.graph}, longer),
          .permissions = make_authority({"permissions authority", graph.graph}, longer)};
}

void write_authorities(const Authorities& authorities, const fs::path& folder) {
  namespace names = graph::key_folder;
  make_folder(folder / kAuthorities);
  io::write_file(folder / kAuthorities / kIdentityKey, authorities.identity.key, kOnlyOwner);
  io::write_file(folder / kAuthorities / kPermissionsKey, authorities.permissions.key, kOnlyOwner);
  io::write_file(folder / names::kIdentityCa, authorities.identity.certificate);
  io::write_file(folder / names::kPermissionsCa, authorities.permissions.certificate);
}

Authorities read_authorities(const fs::path& folder) {
  namespace names = graph::key_folder;
  if (!fs::exists(folder / kAuthorities))
    throw InputError(folder.string() + ": has no authorities (folder '" + kAuthorities +
                     "'): keys are issued where 'cosegraph keys init' was run");
  return {.identity = {io::read_file(folder / names::kIdentityCa),
                       io::read_file(folder / kAuthorities / kIdentityKey)},
          .permissions = {io::read_file(folder / names::kPermissionsCa),
                          io::read_file(folder / kAuthorities / kPermissionsKey)}};
}

void write_governance(const graph::GraphDescription& graph, const Authorities& authorities,
                      const fs::path& folder) {
  io::write_file(folder / graph::key_folder::kGovernance,
                 sign(authorities.permissions, graph::governance_text(graph)));
}

void write_identity(const graph::GraphDescription& graph, const graph::Catalog& catalog,
                    const Identity& identity, const Authorities& authorities,
                    const Validity& validity, const fs::path& folder) {
  namespace names = graph::key_folder;
  const Credential own = issue(authorities.identity, graph::subject_of(graph, identity), validity);
  const fs::path place = folder / names::of(identity);
  make_folder(place.parent_path());
  NewFolder made(place);
  io::write_file(made.path() / names::kKey, own.key, kOnlyOwner);
  io::write_file(made.path() / names::kCertificate, own.certificate);
  io::write_file(
      made.path() / names::kPermissions,
      sign(authorities.permissions, graph::permissions_text(graph, catalog, identity, validity)));
  made.put_in_place();
}

std::vector<Identity> named(const graph::GraphDescription& graph,
                            const std::vector<std::string>& names) {
  const std::vector<Identity> all = graph::identities_of(graph);
  if (names.empty()) return all;
  std::vector<Identity> result;
  std::vector<std::string> known;
  for (const auto& identity : all)
    known.push_back(graph::key_folder::of(identity).filename().string());
  for (const auto& name : names) {
    if (std::ranges::find(known, name) == known.end())
      throw ParameterError("graph '" + graph.graph + "' has no stage '" + name + "'" +
                           did_you_mean(name, known));
    for (std::size_t i = 0; i < all.size(); ++i)
      if (known[i] == name) result.push_back(all[i]);
  }
  return result;
}

}  // namespace

Validity from_now(int days) {
  if (days < 1 || days > kMostDays)
    throw ParameterError("days: " + std::to_string(days) + " is not in 1 .. " +
                         std::to_string(kMostDays));
  const std::time_t now = std::time(nullptr);
  return {.from = now - kHour, .until = now + days * kDay};
}

void init(const graph::GraphDescription& graph, const graph::Catalog& catalog,
          const fs::path& folder, const Validity& validity) {
  const fs::path place = fs::absolute(folder / "").lexically_normal().parent_path();
  if (fs::exists(place / kAuthorities))
    throw InputError(place.string() +
                     ": has authorities already; 'cosegraph keys issue' renews what they issued");
  if (fs::exists(place) && !(fs::is_directory(place) && fs::is_empty(place)))
    throw InputError(place.string() + ": is not an empty folder");
  fs::create_directories(place.parent_path());
  NewFolder made(place);
  const Authorities authorities = make_authorities(graph, validity);
  write_authorities(authorities, made.path());
  write_governance(graph, authorities, made.path());
  for (const auto& identity : graph::identities_of(graph))
    write_identity(graph, catalog, identity, authorities, validity, made.path());
  made.put_in_place();
}

std::vector<std::string> issue(const graph::GraphDescription& graph, const graph::Catalog& catalog,
                               const fs::path& folder, const std::vector<std::string>& names,
                               const Validity& validity) {
  const std::vector<Identity> identities = named(graph, names);
  const Authorities authorities = read_authorities(folder);
  write_governance(graph, authorities, folder);
  std::vector<std::string> result;
  for (const auto& identity : identities) {
    write_identity(graph, catalog, identity, authorities, validity, folder);
    result.push_back(to_text(identity));
  }
  return result;
}

}  // namespace cosegraph::keys
