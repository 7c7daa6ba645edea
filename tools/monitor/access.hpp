// Who may speak to the monitor's server, and which files it hands out.
//
// A web page of a stranger, open in the same browser, can send requests to servers on this machine,
// even under a name of its own that it has made to point here (DNS rebinding). So without a token
// the server only answers to a loopback name, and only to pages that it served itself.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace cosegraph::monitor {

struct Access {
  std::string token;                 // empty: none is asked for
  std::vector<std::string> origins;  // pages of others that may connect, as "https://app.example"
};

// "127.0.0.1", "localhost", "[::1]", with or without ":PORT".
bool is_loopback(std::string_view authority);

// The value of `key` in the query of a request's target ("/?token=a"), percent-decoded; empty:
// none.
std::string query_value(std::string_view target, std::string_view key);

// Why a request is refused; empty: it is not. `origin` is empty for clients that are no browsers.
std::string refusal(const Access& access, std::string_view host, std::string_view origin,
                    std::string_view token);

// Text equality in a time that tells nothing about where texts differ.
bool equal_secrets(std::string_view a, std::string_view b);

struct StaticFile {
  std::string type;  // MIME
  std::string bytes;
};

// The files of the page by the path they are asked for ("/index.html"; "/" is the same), read once:
// no request ever reaches the file system. Files of other kinds than a page's are left out.
std::map<std::string, StaticFile, std::less<>> load_page(const std::filesystem::path& folder);

}  // namespace cosegraph::monitor
