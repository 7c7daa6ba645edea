// Normals by principal components.
#pragma once

#include <array>
#include <span>
#include <vector>

namespace cosegraph::source {

// Unit normals of `xyz`: direction of least variance of the points within `radius` (at least the 8
// nearest), turned toward `sensor`. Where the neighbours lie on a line the normal is the direction
// across it that points to the sensor most.
std::vector<float> estimate_normals(std::span<const float> xyz, double radius,
                                    const std::array<float, 3>& sensor);

}  // namespace cosegraph::source
