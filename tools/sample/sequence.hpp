// A moving virtual depth camera around one object that stands still.
//
// The sensor is a stereo or structured-light camera: it measures disparity, with Gaussian noise and
// in steps, so the noise of depth grows with the square of depth (Khoshelham, Elberink, "Accuracy
// and resolution of Kinect depth data", Sensors 2012). Pixels are missing where the surface is
// grazed, beside depth edges, and here and there at random.
#pragma once

#include <cstdint>
#include <vector>

#include "core/cloud.hpp"
#include "core/fields.hpp"

namespace cosegraph::sample {

struct SequenceParams {
  int frames = 30;
  int width = 320;
  int height = 240;
  double focal = 285.0;         // pixels
  double object_height = 0.25;  // metres from the object's lowest to its highest point (z)
  double distance = 0.0;        // metres from the camera to the object's middle; 0: fills the image
  double start_azimuth = 0.0;   // degrees about z, 0 = camera on the +x side
  double end_azimuth = 360.0;   // of the frame after the last, so that a full turn has no double
  double elevation = 25.0;      // degrees above the horizon
  double baseline = 0.075;      // metres
  double disparity_noise = 0.1;   // standard deviation in pixels; 0: no noise
  double disparity_step = 0.125;  // pixels; 0: no quantisation
  double grazing = 80.0;          // degrees from the normal above which nothing is measured
  double edge_jump =
      0.02;               // relative step of depth between neighbours that is an edge; 0: no edges
  double dropout = 0.01;  // fraction of pixels lost at random
  std::uint64_t seed = 1;
};

Fields describe(SequenceParams& params);

// One organised cloud per frame in the camera's frame (x right, y down, z forward, sensor at the
// origin), metres, labelled; missing pixels are NaN without label. Frame i depends on the seed and
// i only.
std::vector<Cloud> sequence(const Mesh& mesh, const SequenceParams& params);

}  // namespace cosegraph::sample
