#include "tools/monitor/access.hpp"

#include <algorithm>
#include <cstdint>

#include "io/file.hpp"

namespace cosegraph::monitor {
namespace {

namespace fs = std::filesystem;

constexpr std::pair<std::string_view, std::string_view> kTypes[] = {
    {".html", "text/html; charset=utf-8"}, {".js", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},   {".svg", "image/svg+xml"},
    {".txt", "text/plain; charset=utf-8"},
};

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string percent_decoded(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_escape = text[i] == '%' && i + 2 < text.size() && hex_digit(text[i + 1]) >= 0 &&
                           hex_digit(text[i + 2]) >= 0;
    if (is_escape) {
      result += static_cast<char>(16 * hex_digit(text[i + 1]) + hex_digit(text[i + 2]));
      i += 2;
    } else {
      result += text[i];
    }
  }
  return result;
}

// "host:port" without the port.
std::string_view host_of(std::string_view authority) {
  if (authority.starts_with('[')) {
    const std::size_t end = authority.find(']');
    return end == std::string_view::npos ? authority : authority.substr(0, end + 1);
  }
  return authority.substr(0, authority.find(':'));
}

}  // namespace

bool is_loopback(std::string_view authority) {
  std::string host(host_of(authority));
  std::ranges::transform(host, host.begin(), [](unsigned char c) {
    return static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  });
  if (host == "localhost" || host == "[::1]" || host == "::1" || authority == "::1") return true;
  // 127.0.0.0/8, written as four numbers: "127.evil.example" is somebody's name.
  return host.starts_with("127.") && std::ranges::count(host, '.') == 3 &&
         host.find_first_not_of("0123456789.") == std::string::npos;
}

std::string query_value(std::string_view target, std::string_view key) {
  const std::size_t question = target.find('?');
  if (question == std::string_view::npos) return {};
  std::string_view query = target.substr(question + 1);
  query = query.substr(0, query.find('#'));
  while (!query.empty()) {
    const std::string_view pair = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(pair.size() + 1, query.size()));
    const std::size_t equals = pair.find('=');
    if (equals != std::string_view::npos && pair.substr(0, equals) == key)
      return percent_decoded(pair.substr(equals + 1));
  }
  return {};
}

bool equal_secrets(std::string_view a, std::string_view b) {
  std::size_t difference = a.size() ^ b.size();
  for (std::size_t i = 0; i < a.size(); ++i)
    difference |= static_cast<std::uint8_t>(a[i]) ^
                  static_cast<std::uint8_t>(b.empty() ? 0 : b[i % b.size()]);
  return difference == 0;
}

std::string refusal(const Access& access, std::string_view host, std::string_view origin,
                    std::string_view token) {
  if (!access.token.empty())
    return equal_secrets(access.token, token) ? "" : "the token is missing or wrong";
  if (!is_loopback(host))
    return "without a token this server answers to localhost only, not to '" + std::string(host) +
           "'";
  if (origin.empty() || origin == "http://" + std::string(host)) return "";
  if (std::ranges::find(access.origins, origin) != access.origins.end()) return "";
  return "pages of '" + std::string(origin) + "' may not connect; see --origin";
}

std::map<std::string, StaticFile, std::less<>> load_page(const fs::path& folder) {
  std::map<std::string, StaticFile, std::less<>> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string extension = entry.path().extension().string();
    const auto type =
        std::ranges::find(kTypes, extension, &std::pair<std::string_view, std::string_view>::first);
    if (type == std::end(kTypes) || !entry.is_regular_file(error)) continue;
    files["/" + entry.path().filename().string()] = {.type = std::string(type->second),
                                                     .bytes = io::read_file(entry.path())};
  }
  if (const auto index = files.find("/index.html"); index != files.end())
    files["/"] = StaticFile(index->second);
  return files;
}

}  // namespace cosegraph::monitor
