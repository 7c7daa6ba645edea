#include "io/labels.hpp"

#include <algorithm>
#include <set>

#include "core/cloud.hpp"
#include "io/text.hpp"

namespace cosegraph::io {

void read_label_comment(const std::filesystem::path& file, std::string_view comment,
                        LabelNames& names) {
  if (take_word(comment) != "label") return;
  const auto number = parse_number<std::int32_t>(take_word(comment));
  const std::string_view name = trimmed(comment);
  if (!number || *number < 0 || name.empty()) return;
  if (!names.emplace(*number, name).second)
    throw InputError(file.string() + ": label " + std::to_string(*number) + " is named twice");
}

std::vector<std::string> to_indices(const std::filesystem::path& file, LabelNames names,
                                    std::vector<std::int32_t>& label) {
  std::vector<std::int32_t> used = label;
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (const std::int32_t number : used)
    if (number >= 0) names.emplace(number, std::to_string(number));

  std::vector<std::int32_t> numbers;
  std::vector<std::string> result;
  std::set<std::string_view> seen;
  for (const auto& [number, name] : names) {
    if (!seen.insert(name).second)
      throw InputError(file.string() + ": two labels are named " + in_quotes(name));
    numbers.push_back(number);
    result.push_back(name);
  }
  if (result.empty()) label.clear();
  for (std::int32_t& value : label) {
    const auto place = std::lower_bound(numbers.begin(), numbers.end(), value);
    value = value < 0 ? kNoLabel : static_cast<std::int32_t>(place - numbers.begin());
  }
  return result;
}

std::string label_comments(const std::filesystem::path& file, std::string_view prefix,
                           std::span<const std::string> names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    const bool printable =
        std::none_of(name.begin(), name.end(), [](unsigned char c) { return c < ' '; });
    if (name.empty() || trimmed(name) != name || !printable)
      throw InputError(file.string() + ": cannot write: label name " + in_quotes(name) +
                       " is empty or has blanks around it or control characters in it");
    text += std::string(prefix) + " label " + std::to_string(i) + " " + name + "\n";
  }
  return text;
}

}  // namespace cosegraph::io
