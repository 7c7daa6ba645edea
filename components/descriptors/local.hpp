// FPFH and SHOT of single points, as PCL 1.13 defines them (FPFHEstimation, SHOTEstimation).
//
// The kernels of our own compute the same within rounding, many times as fast; PCL's are what they
// are measured against.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/names.hpp"

namespace cosegraph::descriptors {

constexpr int kFpfhSize = 33;
constexpr int kShotSize = 352;

enum class Kernel { own, pcl };

// Points with unit normals, 3 finite numbers each per point.
struct Surface {
  std::span<const float> xyz;
  std::span<const float> normal;
};

// One row per keypoint (index into the surface's points) over the neighbours within `radius`; a
// row is NaN where there are too few of them. `threads` 0: all cores; rows do not depend on it,
// nor, with our own kernels, on the processor. Throws InputError if a point is not finite or
// farther out than NearestNeighbours takes.
std::vector<float> fpfh(const Surface& surface, std::span<const std::int32_t> keypoint,
                        double radius, int threads, Kernel kernel = Kernel::own);
std::vector<float> shot(const Surface& surface, std::span<const std::int32_t> keypoint,
                        double radius, int threads, Kernel kernel = Kernel::own);

}  // namespace cosegraph::descriptors

template <>
cosegraph::Names<cosegraph::descriptors::Kernel> cosegraph::names<cosegraph::descriptors::Kernel>();
