// Labelled everyday objects with random proportions: data to try the method on without a benchmark.
//
// A shape is made of parts, each a closed surface (every edge has exactly two faces, outward
// normals); parts that belong together reach a little into each other, so from outside they look
// joined. About 5 000 to 20 000 faces; metres; z up, standing on z = 0; x is forward. The same
// (kind, seed) gives the same mesh.
#pragma once

#include <cstdint>

#include "core/cloud.hpp"
#include "core/names.hpp"

namespace cosegraph::sample {

enum class Kind {
  mug,           // body, handle
  watering_can,  // container, handle, spout
  chair,         // back, seat, leg
  aeroplane,     // body, wing, tail (stabiliser and fin)
};

// Label indices follow the order in which the parts are named above.
Mesh make(Kind kind, std::uint64_t seed);

}  // namespace cosegraph::sample

template <>
cosegraph::Names<cosegraph::sample::Kind> cosegraph::names<cosegraph::sample::Kind>();
