// FPFH and SHOT by kernels of our own: PCL's definitions (local.hpp says what of), several
// neighbours at a time. Points lie within NearestNeighbours::kFarthest, nothing else is checked.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "descriptors/local.hpp"

namespace cosegraph::descriptors {

// Instruction sets of the kernels; results do not depend on them.
enum class Instructions { baseline, avx2 };
Instructions best_instructions();

std::vector<float> own_fpfh(const Surface& surface, std::span<const std::int32_t> keypoint,
                            double radius, int threads, Instructions instructions);
std::vector<float> own_shot(const Surface& surface, std::span<const std::int32_t> keypoint,
                            double radius, int threads, Instructions instructions);

}  // namespace cosegraph::descriptors
