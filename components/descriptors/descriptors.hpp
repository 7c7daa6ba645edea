// Local shape descriptors: FPFH (Rusu, Blodow, Beetz, ICRA 2009; 33 numbers), SHOT (Tombari,
// Salti, Di Stefano, ECCV 2010; 352 numbers), and two numbers of a point's place in the whole
// (mean graph-geodesic distance to all others, distance to the centroid).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/fields.hpp"
#include "core/values.hpp"

namespace cosegraph::descriptors {

enum class Kind { fpfh, shot, place };

// Text: KIND[+place]:RADIUS[:SPACING], as "fpfh:0.08", "fpfh+place:0.08", "shot:0.13:0.03",
// "place". RADIUS and SPACING are multiples of the cloud's scale.
struct Channel {
  Kind kind = Kind::fpfh;
  bool with_place = false;  // the two numbers of `place` appended
  double radius = 0.08;
  double spacing = 0.0;  // of the keypoints (voxel); 0: every point
};

std::string to_text(const Channel& channel);
// Throws ParameterError saying what is wrong.
Channel parse_channel(std::string_view text);

struct Params {
  std::vector<std::string> channels = {"fpfh:0.08"};
  int threads = 0;  // 0: all cores; not part of the recipe. Results do not depend on it
};

// Every field; the recipe of the messages leaves `threads` out (see recipe_of).
Fields describe(Params& params);
std::string recipe_of(const Params& params);

// Numbers per keypoint of a channel.
int dimension(const Channel& channel);

// Keypoints whose descriptor is not finite are left out. Throws InputError if `cloud` has no
// normals or a channel ends without any keypoint.
Descriptors compute(const Cloud& cloud, const Params& params);

}  // namespace cosegraph::descriptors

template <>
cosegraph::Names<cosegraph::descriptors::Kind> cosegraph::names<cosegraph::descriptors::Kind>();
