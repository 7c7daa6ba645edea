#include "tools/evaluation/store.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "core/error.hpp"
#include "io/file.hpp"
#include "tools/evaluation/hash.hpp"

namespace cosegraph::evaluation {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "cosegraph record 1\n";
constexpr std::size_t kNumber = sizeof(std::uint64_t);
constexpr std::size_t kNameLength = 16;  // of a program's folder

std::string hexadecimal(std::uint64_t value) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (int shift = 60; shift >= 0; shift -= 4) text += kDigits[value >> shift & 0xF];
  return text;
}

bool is_program_name(const std::string& name) {
  return name.size() == kNameLength &&
         name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

void put_number(std::string& bytes, std::uint64_t value) {
  char raw[kNumber];
  std::memcpy(raw, &value, kNumber);
  bytes.append(raw, kNumber);
}

void put_text(std::string& bytes, std::string_view text) {
  put_number(bytes, text.size());
  bytes += text;
}

// Takes pieces from the front of a file's bytes; nothing once they do not fit.
class Taker {
 public:
  explicit Taker(std::string_view bytes) : rest_(bytes) {}

  std::optional<std::uint64_t> number() {
    if (rest_.size() < kNumber) return std::nullopt;
    std::uint64_t value = 0;
    std::memcpy(&value, rest_.data(), kNumber);
    rest_.remove_prefix(kNumber);
    return value;
  }

  std::optional<std::string> text() {
    const auto size = number();
    if (!size || *size > rest_.size()) return std::nullopt;
    std::string value(rest_.substr(0, *size));
    rest_.remove_prefix(*size);
    return value;
  }

  bool empty() const { return rest_.empty(); }

 private:
  std::string_view rest_;
};

}  // namespace

Store::Store(const fs::path& folder) {
  if (folder.empty()) return;
  const std::string program = fingerprint_of("/proc/self/exe");
  folder_ = folder / program;
  std::error_code error;
  std::vector<fs::path> others;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (entry.path().filename() != program && is_program_name(entry.path().filename().string()))
      others.push_back(entry.path());
  for (const auto& other : others) fs::remove_all(other, error);
}

fs::path Store::file_of(std::string_view key) const {
  const std::string name = hexadecimal(hash(key));
  return folder_ / name.substr(0, 2) / name;
}

std::optional<std::vector<std::string>> Store::read(std::string_view key) const {
  if (folder_.empty()) return std::nullopt;
  const fs::path file = file_of(key);
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  std::string bytes;
  try {
    bytes = io::read_file(file);
  } catch (const InputError&) {
    return std::nullopt;
  }
  if (bytes.size() < kMagic.size() + kNumber || !bytes.starts_with(kMagic)) return std::nullopt;
  const std::string_view body(bytes.data(), bytes.size() - kNumber);
  Taker end(std::string_view(bytes).substr(body.size()));
  if (end.number() != hash(body)) return std::nullopt;
  Taker taker(body.substr(kMagic.size()));
  if (taker.text() != key) return std::nullopt;
  std::vector<std::string> record;
  while (!taker.empty()) {
    auto text = taker.text();
    if (!text) return std::nullopt;
    record.push_back(std::move(*text));
  }
  return record;
}

void Store::write(std::string_view key, std::span<const std::string> record) {
  if (folder_.empty() || !failure().empty()) return;
  std::string bytes(kMagic);
  put_text(bytes, key);
  for (const auto& text : record) put_text(bytes, text);
  put_number(bytes, hash(bytes));
  try {
    const fs::path file = file_of(key);
    fs::create_directories(file.parent_path());
    io::write_file(file, bytes);
  } catch (const std::exception& error) {
    const std::lock_guard lock(mutex_);
    failure_ = error.what();
  }
}

std::string Store::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

std::string fingerprint_of(const fs::path& file) {
  return hexadecimal(hash(io::read_file(file)));
}

}  // namespace cosegraph::evaluation
