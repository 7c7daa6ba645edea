// Label numbers and names as they stand in files, turned into indices. Internal to io.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cosegraph::io {

// Names by the number that the file uses.
using LabelNames = std::map<std::int32_t, std::string>;

// Takes in "label K NAME" (the text of a comment); other comments are passed over. Throws
// InputError naming the file on a number that is named twice.
void read_label_comment(const std::filesystem::path& file, std::string_view comment,
                        LabelNames& names);

// Replaces the file's numbers in `label` by indices into the list of names, which is returned: all
// named and all used numbers, ascending; a number without a name is named by itself. Negative
// numbers become kNoLabel. If there is no name at all, `label` becomes empty.
std::vector<std::string> to_indices(const std::filesystem::path& file, LabelNames names,
                                    std::vector<std::int32_t>& label);

// "PREFIX label K NAME" for each name. Throws InputError on a name that a line cannot hold.
std::string label_comments(const std::filesystem::path& file, std::string_view prefix,
                           std::span<const std::string> names);

}  // namespace cosegraph::io
