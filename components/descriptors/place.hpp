// A point's place in the whole, by two numbers that do not depend on the pose.
#pragma once

#include <span>
#include <vector>

namespace cosegraph::descriptors {

constexpr int kPlaceSize = 2;

// Per point of `xyz` (3N finite numbers): the mean of its shortest-path distances to all others,
// and its distance to the centroid; both divided by `scale`. The mean is taken over 30 sources (all
// points if there are fewer), each weighing as much as there are points nearest to it; they are
// spread in farthest-point order along the paths, from the point farthest from the centroid (ties:
// the smaller index). Paths run over the symmetric graph of 8 nearest neighbours; its pieces are
// joined by their shortest bridges.
std::vector<float> place(std::span<const float> xyz, double scale);

}  // namespace cosegraph::descriptors
