// A model as bytes: versioned, checksummed, little endian.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/values.hpp"

namespace cosegraph::model {

constexpr std::uint32_t kFormatVersion = 1;

std::string to_bytes(const Model& model);

// Throws InputError saying what is wrong, prefixed by `name` (a file's name): not a model file,
// made by a newer version, truncated, damaged (checksum), inconsistent.
Model from_bytes(std::string_view bytes, const std::string& name);

// Content hash over all but the ids; never 0.
std::uint64_t content_id(const Model& model);

// Sizes and values fit together (a hostile or damaged model never reaches an algorithm). Throws
// InputError.
void check(const AppearanceModel& model);
void check(const RelationModel& model);

}  // namespace cosegraph::model
