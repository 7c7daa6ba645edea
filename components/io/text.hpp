// Lines, words and numbers of a text file, with errors that name file and line. Internal to io.
#pragma once

#include <algorithm>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.hpp"

namespace cosegraph::io {

// `text` without leading and trailing blanks (space, tab, carriage return).
inline std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

// Takes the next word off the front of `text`; empty when there is none.
inline std::string_view take_word(std::string_view& text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) {
    text = {};
    return {};
  }
  const std::size_t last = std::min(text.find_first_of(" \t\r", first), text.size());
  const std::string_view word = text.substr(first, last - first);
  text.remove_prefix(last);
  return word;
}

inline std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  for (std::string_view word = take_word(text); !word.empty(); word = take_word(text))
    words.push_back(word);
  return words;
}

// The whole of `word` as a number; none if it is not one or does not fit. Independent of locale.
template <class T>
requires std::integral<T> || std::floating_point<T> std::optional<T> parse_number(
    std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

// Appends the shortest text that reads back as the same number.
template <class T>
void append_number(std::string& text, T value) {
  char buffer[32];
  text.append(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
}

// Walks through the lines of a text. Does not own it.
class Lines {
 public:
  Lines(const std::filesystem::path& file, std::string_view text, std::size_t lines_before = 0)
      : file_(file.string()), rest_(text), number_(lines_before) {}

  // The next line without its end; none at the end of the text.
  std::optional<std::string_view> next() {
    if (rest_.empty()) return std::nullopt;
    ++number_;
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    return line;
  }

  // The next line that holds more than blanks (and a comment begun by `comment`), trimmed.
  std::optional<std::string_view> next_filled(char comment = '\0') {
    while (auto line = next()) {
      if (comment != '\0') line = line->substr(0, line->find(comment));
      if (const std::string_view text = trimmed(*line); !text.empty()) return text;
    }
    return std::nullopt;
  }

  std::size_t number() const { return number_; }  // of the last line given out, from 1
  std::string_view rest() const { return rest_; }

  // Throws InputError "FILE:LINE: WHAT".
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_ + ":" + std::to_string(number_) + ": " + what);
  }

 private:
  std::string file_;
  std::string_view rest_;
  std::size_t number_;
};

inline std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string result = "'";
  for (const char c : text.substr(0, kLongest)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > kLongest ? "...'" : "'");
}

}  // namespace cosegraph::io
