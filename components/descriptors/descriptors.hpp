// Local shape descriptors: FPFH (Rusu, Blodow, Beetz, ICRA 2009; 33 numbers), SHOT (Tombari,
// Salti, Di Stefano, ECCV 2010; 352 numbers), and two numbers of a point's place in the whole
// (mean graph-geodesic distance to all others, distance to the centroid).
//
// FPFH and SHOT are PCL's definitions, by kernels of our own or PCL's. The mean geodesic distance
// is taken over 30 spread sources.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/fields.hpp"
#include "core/values.hpp"
#include "descriptors/local.hpp"

namespace cosegraph::descriptors {

enum class Kind { fpfh, shot, place };

// Text: KIND[+place]:RADIUS[:SPACING], as "fpfh:0.08", "fpfh+place:0.08", "shot:0.13:0.02",
// "place". RADIUS and SPACING are multiples of the cloud's scale. Where SPACING is absent, FPFH is
// computed at every point and SHOT at keypoints kShotSpacing apart (about a quarter of the points
// of a cloud with the default spacing).
struct Channel {
  Kind kind = Kind::fpfh;
  bool with_place = false;  // the two numbers of `place` appended
  double radius = 0.08;
  double spacing = 0.0;  // least distance between keypoints; 0: every point

  bool operator==(const Channel&) const = default;
};

constexpr double kShotSpacing = 0.02;

// Canonical: parse_channel(to_text(c)) == c, and names compare equal exactly if channels do.
std::string to_text(const Channel& channel);
// Throws ParameterError saying what is wrong.
Channel parse_channel(std::string_view text);

struct Params {
  std::vector<std::string> channels = {"fpfh:0.08"};
  int threads = 0;              // 0: all cores; not part of the recipe. Results do not depend on it
  Kernel kernel = Kernel::own;  // of FPFH and SHOT; not part of the recipe
};

// Every field; the recipe of the messages leaves `threads` and `kernel` out (see recipe_of).
Fields describe(Params& params);
// With the canonical text of the channels, so that "shot:0.13" and "shot:0.13:0.02" agree.
std::string recipe_of(const Params& params);
// Sets what a recipe holds; throws ParameterError if it is none of descriptors.
void adopt_recipe(std::string_view text, Params& params);

// Numbers per keypoint of a channel.
int dimension(const Channel& channel);

// Keypoints whose descriptor is not finite or that have no neighbours are left out. Keypoints that
// are `spacing` apart are chosen in the order of the cloud. Throws InputError if `cloud` has no
// normals or holds numbers that are not finite, or a channel ends without any keypoint;
// ParameterError if no channel is wanted or one is wanted twice.
Descriptors compute(const Cloud& cloud, const Params& params);

}  // namespace cosegraph::descriptors

template <>
cosegraph::Names<cosegraph::descriptors::Kind> cosegraph::names<cosegraph::descriptors::Kind>();
