#include "io/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "core/error.hpp"

namespace cosegraph::io {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& file, const char* action, int error) {
  throw InputError(file.string() + ": cannot " + action + ": " + std::strerror(error));
}

// A file descriptor that is closed on every way out.
class Descriptor {
 public:
  Descriptor(const fs::path& path, int flags, unsigned mode = 0)
      : value_(::open(path.c_str(), flags | O_CLOEXEC, mode)) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int get() const { return value_; }
  // close() can be the first to report that the disk is full (NFS, quotas).
  bool close() { return ::close(std::exchange(value_, -1)) == 0; }

 private:
  int value_;
};

// Removes the temporary file unless the rename has happened.
struct Temporary {
  fs::path path;
  bool keep = false;
  ~Temporary() {
    if (!keep) ::unlink(path.c_str());
  }
};

fs::path temporary_beside(const fs::path& file) {
  static std::atomic<std::uint64_t> counter{0};
  std::string name = ".";
  name += file.filename().string();
  name += '.';
  name += std::to_string(::getpid());
  name += '.';
  name += std::to_string(counter++);
  name += ".tmp";
  return file.parent_path() / name;
}

// Where the bytes really go: the target of a symbolic link keeps being its target. A device, a
// folder or a pipe is refused, because the rename would put a plain file in its place.
fs::path real_target(const fs::path& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) return file;
  if (!fs::is_regular_file(status))
    throw InputError(file.string() + ": cannot write: it exists and is not a plain file");
  return fs::canonical(file, error);
}

bool write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ::ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

// Makes the rename itself durable. Some file systems cannot sync a folder: not an error.
void sync_folder(const fs::path& folder) {
  const Descriptor descriptor(folder.empty() ? "." : folder, O_RDONLY | O_DIRECTORY);
  if (descriptor.get() >= 0) ::fsync(descriptor.get());
}

}  // namespace

void write_file(const fs::path& file, std::string_view bytes, unsigned mode) {
  if (!file.has_filename()) throw InputError("'" + file.string() + "' is not a file name");
  const fs::path target = real_target(file);
  const fs::path path = temporary_beside(target);
  Descriptor descriptor(path, O_WRONLY | O_CREAT | O_EXCL, mode);
  if (descriptor.get() < 0) fail(file, "write", errno);
  Temporary temporary{path};
  if (!write_all(descriptor.get(), bytes)) fail(file, "write", errno);
  if (::fsync(descriptor.get()) != 0) fail(file, "write", errno);
  if (!descriptor.close()) fail(file, "write", errno);
  if (::rename(path.c_str(), target.c_str()) != 0) fail(file, "write", errno);
  temporary.keep = true;
  sync_folder(target.parent_path());
}

void replace_end(const fs::path& file, std::size_t at, std::string_view bytes) {
  Descriptor descriptor(file, O_RDWR);
  struct stat status {};
  if (descriptor.get() < 0 || ::fstat(descriptor.get(), &status) != 0) fail(file, "write", errno);
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size < at) throw InputError(file.string() + ": cannot write: somebody has shortened it");
  std::string old(size - at, '\0');
  const auto begin = static_cast<::off_t>(at);
  if (::pread(descriptor.get(), old.data(), old.size(), begin) !=
      static_cast<::ssize_t>(old.size()))
    fail(file, "read", errno);
  const auto put = [&](std::string_view end) {
    return ::lseek(descriptor.get(), begin, SEEK_SET) == begin &&
           write_all(descriptor.get(), end) &&
           ::ftruncate(descriptor.get(), begin + static_cast<::off_t>(end.size())) == 0;
  };
  if (!put(bytes)) {
    const int error = errno;
    put(old);  // takes no more room than it had
    fail(file, "write", error);
  }
  if (!descriptor.close()) fail(file, "write", errno);
}

std::string read_file(const fs::path& file) {
  // O_NONBLOCK: opening a pipe that nobody writes to must not hang before it is refused.
  const Descriptor descriptor(file, O_RDONLY | O_NONBLOCK);
  struct stat status {};
  if (descriptor.get() < 0 || ::fstat(descriptor.get(), &status) != 0) fail(file, "read", errno);
  if (!S_ISREG(status.st_mode)) throw InputError(file.string() + ": is not a plain file");
  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t size = 0;
  while (size < bytes.size()) {
    const ::ssize_t got = ::read(descriptor.get(), bytes.data() + size, bytes.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail(file, "read", errno);
    if (got == 0) break;  // the file shrank meanwhile
    size += static_cast<std::size_t>(got);
  }
  bytes.resize(size);
  return bytes;
}

TemporaryFolder::TemporaryFolder() {
  const std::filesystem::path parent = std::filesystem::temp_directory_path();
  std::string pattern = (parent / "cosegraph-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr)
    throw InputError("cannot make a folder in " + parent.string() + ": " + std::strerror(errno));
  path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace cosegraph::io
