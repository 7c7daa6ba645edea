#include "graph/runs.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "io/file.hpp"

namespace cosegraph::graph {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kAgents = "agents";  // stands for the instance of a run by agents
constexpr std::string_view kWhole = "all";      // stands for the host of a run on one machine

fs::path base_folder() {
  if (const char* own = std::getenv("COSEGRAPH_RUNTIME_DIR"); own != nullptr && *own != '\0')
    return own;
  if (const char* user = std::getenv("XDG_RUNTIME_DIR"); user != nullptr && *user != '\0')
    return fs::path(user) / "cosegraph";
  return fs::temp_directory_path() / ("cosegraph-" + std::to_string(::getuid()));
}

void make_private(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  struct stat info {};
  if (error || ::stat(folder.c_str(), &info) != 0)
    throw InputError(folder.string() + ": cannot be made: " + error.message());
  if (info.st_uid != ::getuid()) throw InputError(folder.string() + ": belongs to another user");
  ::chmod(folder.c_str(), 0700);
}

// RUNTIME/GRAPH/INSTANCE/HOST
fs::path folder_of(std::string_view graph, std::string_view instance, std::string_view host) {
  return runtime_folder() / graph / (instance.empty() ? kAgents : instance) /
         (host.empty() ? kWhole : host);
}

// While one lives nobody else makes or removes folders of runs.
class FolderLock {
 public:
  FolderLock()
      : file_(::open((runtime_folder() / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {
    if (file_ < 0)
      throw InputError((runtime_folder() / "lock").string() + ": " + std::strerror(errno));
    while (::flock(file_, LOCK_EX) != 0 && errno == EINTR) {
    }
  }
  ~FolderLock() { ::close(file_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int file_;
};

// Whether somebody holds the lock of a run's folder.
bool is_kept(const fs::path& folder) {
  const int fd = ::open((folder / "keeper").c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return errno != ENOENT;
  const bool kept = ::flock(fd, LOCK_SH | LOCK_NB) != 0;
  ::close(fd);
  return kept;
}

std::vector<fs::path> folders_in(const fs::path& folder) {
  std::vector<fs::path> result;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (entry.is_directory(error)) result.push_back(entry.path());
  std::ranges::sort(result);
  return result;
}

// What keepers that were killed have left and nobody can take over.
void remove_abandoned(const fs::path& graph_folder) {
  for (const auto& instance : folders_in(graph_folder)) {
    if (instance.filename() == kAgents) continue;
    const auto hosts = folders_in(instance);
    if (std::ranges::none_of(hosts, is_kept)) {
      std::error_code error;
      fs::remove_all(instance, error);
    }
  }
}

std::string names_of(const std::vector<Run>& runs) {
  std::string text;
  for (const auto& run : runs)
    text += (text.empty() ? "" : ", ") + run.graph +
            (run.instance.empty() ? "" : " (instance " + run.instance + ")");
  return text;
}

}  // namespace

fs::path runtime_folder() {
  const fs::path folder = base_folder();
  make_private(folder);
  return folder;
}

std::vector<Run> live_runs() {
  std::vector<Run> result;
  for (const auto& graph : folders_in(runtime_folder()))
    for (const auto& instance : folders_in(graph))
      for (const auto& host : folders_in(instance)) {
        // A keeper that has only begun has not written its graph yet.
        if (!is_kept(host) || !fs::exists(host / "graph.yaml")) continue;
        Run run{.graph = graph.filename(), .folder = host};
        if (instance.filename() != kAgents) run.instance = instance.filename();
        if (host.filename() != kWhole) run.host = host.filename();
        if (std::FILE* file = std::fopen((host / "keeper").c_str(), "r")) {
          if (std::fscanf(file, "%d", &run.pid) != 1) run.pid = -1;
          std::fclose(file);
        }
        result.push_back(std::move(run));
      }
  return result;
}

GraphDescription find_run(const RunQuery& query) {
  std::error_code error;
  const bool is_file = fs::is_regular_file(query.graph, error);
  GraphDescription described;
  if (is_file) described = parse(io::read_file(query.graph), query.graph);
  const std::string name = is_file ? described.graph : query.graph;

  const std::vector<Run> all = live_runs();
  std::vector<Run> matching;
  for (const auto& run : all) {
    const bool wanted = (name.empty() || run.graph == name) &&
                        (query.instance.empty() || run.instance.starts_with(query.instance));
    const bool known = std::ranges::any_of(matching, [&](const Run& other) {
      return other.graph == run.graph && other.instance == run.instance;
    });
    if (wanted && !known) matching.push_back(run);
  }
  if (matching.size() > 1)
    throw InputError(
        (name.empty() ? "several graphs run here: " : "several runs of '" + name + "': ") +
        names_of(matching) + "; choose one with --graph or --instance");
  if (matching.size() == 1) {
    const fs::path file = matching[0].folder / "graph.yaml";
    GraphDescription graph = parse(io::read_file(file), file.string());
    graph.instance = matching[0].instance;
    return graph;
  }
  if (is_file && query.instance.empty()) return described;
  if (name.empty()) throw InputError("no graph runs on this machine; name one with --graph FILE");
  throw InputError("no run of '" + name + "' is known on this machine" +
                   (all.empty() ? "" : "; there are: " + names_of(all)));
}

RunFolder::RunFolder(const GraphDescription& graph, std::string_view host)
    : path_(folder_of(graph.graph, graph.instance, host)) {
  const FolderLock alone;
  remove_abandoned(runtime_folder() / graph.graph);
  make_private(path_);
  const fs::path keeper = path_ / "keeper";
  lock_ = ::open(keeper.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock_ < 0) throw InputError(keeper.string() + ": " + std::strerror(errno));
  if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock_);
    throw Error("graph '" + graph.graph + "'" +
                (host.empty() ? "" : ", host '" + std::string(host) + "'") +
                ": is run already by another process, see 'cosegraph ps'");
  }
  const std::string pid = std::to_string(::getpid()) + "\n";
  if (::ftruncate(lock_, 0) != 0 ||
      ::pwrite(lock_, pid.data(), pid.size(), 0) != static_cast<ssize_t>(pid.size()))
    throw InputError(keeper.string() + ": " + std::strerror(errno));
  if (!fs::exists(path_ / "graph.yaml")) publish(graph);
  discard_ = !graph.instance.empty();
}

RunFolder::~RunFolder() {
  if (discard_) {
    try {
      const FolderLock alone;
      std::error_code error;
      fs::remove_all(path_, error);
      fs::remove(path_.parent_path(), error);  // if it is empty
      fs::remove(path_.parent_path().parent_path(), error);
    } catch (const Error&) {
      // The next run cleans up.
    }
  }
  ::close(lock_);
}

void RunFolder::publish(const GraphDescription& graph) const {
  io::write_file(path_ / "graph.yaml", to_yaml(graph));
}

GraphDescription fresh_instance(GraphDescription graph) {
  std::random_device entropy;
  char text[17];
  std::snprintf(text, sizeof text, "%08x%08x", entropy(), entropy());
  graph.instance = text;
  return graph;
}

}  // namespace cosegraph::graph
