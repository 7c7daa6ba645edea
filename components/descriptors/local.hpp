// FPFH and SHOT of single points, by PCL.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace cosegraph::descriptors {

constexpr int kFpfhSize = 33;
constexpr int kShotSize = 352;

// Points with unit normals, 3 finite numbers each per point.
struct Surface {
  std::span<const float> xyz;
  std::span<const float> normal;
};

// One row per keypoint (index into the surface's points) over the neighbours within `radius`; a
// row is NaN where there are too few of them. `threads` 0: all cores; rows do not depend on it.
std::vector<float> fpfh(const Surface& surface, std::span<const std::int32_t> keypoint,
                        double radius, int threads);
std::vector<float> shot(const Surface& surface, std::span<const std::int32_t> keypoint,
                        double radius, int threads);

}  // namespace cosegraph::descriptors
