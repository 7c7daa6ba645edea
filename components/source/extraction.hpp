// Getting the object out of a scene.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "source/source.hpp"

namespace cosegraph::source {

// Indices, ascending, of the points of `xyz` (3N finite numbers, in m) that are the object. Says
// in `notes` what was done. Throws ParameterError if the crop box is malformed, InputError if a
// step leaves nothing.
std::vector<std::int32_t> object_points(std::span<const float> xyz, const Extraction& extraction,
                                        std::vector<std::string>& notes);

}  // namespace cosegraph::source
