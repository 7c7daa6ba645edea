#include "sample/sequence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "camera/camera.hpp"
#include "core/error.hpp"
#include "core/random.hpp"
#include "sample/solids.hpp"

namespace cosegraph::sample {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;

// The object scaled to its height, its box centred on the origin, and the radius around that.
struct Scene {
  Mesh mesh;
  double radius = 0.0;
};

Scene stage(const Mesh& mesh, double height) {
  check_sizes(mesh);
  if (mesh.face.empty()) throw InputError("a sequence needs a mesh with faces");
  const auto at = [&](std::int32_t v) {
    return Eigen::Map<const Eigen::Vector3f>(&mesh.vertex[3 * static_cast<std::size_t>(v)])
        .cast<double>();
  };
  Vector3d low = at(mesh.face[0]);
  Vector3d high = low;
  for (const std::int32_t v : mesh.face) {
    low = low.cwiseMin(at(v));
    high = high.cwiseMax(at(v));
  }
  const double scale = height / (high.z() - low.z());
  if (!(scale > 0.0) || !std::isfinite(scale)) throw InputError("the mesh has no height");
  Scene scene{.mesh = mesh};
  deform(scene.mesh, 0, [&](const Vector3d& p) { return scale * (p - 0.5 * (low + high)); });
  for (const std::int32_t v : mesh.face)
    scene.radius = std::max(scene.radius, scale * (at(v) - 0.5 * (low + high)).norm());
  return scene;
}

camera::Pinhole pinhole_of(const SequenceParams& params) {
  return {.width = static_cast<std::uint32_t>(params.width),
          .height = static_cast<std::uint32_t>(params.height),
          .fx = params.focal,
          .fy = params.focal,
          .cx = 0.5 * (params.width - 1),
          .cy = 0.5 * (params.height - 1)};
}

// Where the whole object is in the image with a little air around it.
double fitting_distance(const SequenceParams& params, double radius) {
  constexpr double kAir = 1.05;
  const double half = 0.5 * std::min(params.width, params.height);
  return kAir * radius / std::sin(std::atan(half / params.focal));
}

camera::Pose pose_of(const SequenceParams& params, double distance, int frame) {
  const double turn = static_cast<double>(frame) / params.frames;
  const double azimuth =
      kDegree * (params.start_azimuth + (params.end_azimuth - params.start_azimuth) * turn);
  const double elevation = kDegree * params.elevation;
  return camera::look_at(
      {distance * std::cos(elevation) * std::cos(azimuth),
       distance * std::cos(elevation) * std::sin(azimuth), distance * std::sin(elevation)},
      {0, 0, 0}, 0.0);
}

// What a depth sensor would make of an ideal image.
class Sensor {
 public:
  Sensor(const Scene& scene, const SequenceParams& params, const camera::Pose& pose)
      : scene_(scene), params_(params), image_(cast(scene.mesh, pinhole_of(params), pose)) {
    std::copy(pose.rotation.begin(), pose.rotation.end(), rotation_.begin());
  }

  // The image as measured: depths changed, missing pixels without a face.
  camera::DepthImage measure(Random& random) const {
    camera::DepthImage result = image_;
    for (int row = 0; row < params_.height; ++row) {
      for (int column = 0; column < params_.width; ++column) {
        const std::size_t pixel = index(column, row);
        // Drawn for every pixel, so that one pixel's fate does not change another's noise.
        const double noise = random.normal();
        const bool dropped = random.uniform() < params_.dropout;
        if (image_.face[pixel] < 0) continue;
        const double depth = measured_depth(image_.depth[pixel], noise);
        if (dropped || !(depth > 0.0) || at_edge(column, row) || grazed(column, row))
          result.face[pixel] = -1;
        result.depth[pixel] = depth;
      }
    }
    return result;
  }

 private:
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * image_.camera.width + static_cast<std::size_t>(column);
  }

  double measured_depth(double depth, double noise) const {
    const double constant = params_.focal * params_.baseline;
    double disparity = constant / depth + params_.disparity_noise * noise;
    if (params_.disparity_step > 0.0)
      disparity = std::round(disparity / params_.disparity_step) * params_.disparity_step;
    return disparity > 0.0 ? constant / disparity : 0.0;
  }

  // A neighbour lies clearly in front of or behind the pixel, or is not hit.
  bool at_edge(int column, int row) const {
    if (params_.edge_jump == 0.0) return false;
    const double depth = image_.depth[index(column, row)];
    constexpr std::array<std::array<int, 2>, 4> kNeighbours{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
    for (const auto& [right, down] : kNeighbours) {
      const int c = column + right;
      const int r = row + down;
      if (c < 0 || r < 0 || c >= params_.width || r >= params_.height) continue;
      if (!(std::abs(image_.depth[index(c, r)] - depth) <= params_.edge_jump * depth)) return true;
    }
    return false;
  }

  bool grazed(int column, int row) const {
    const auto f = static_cast<std::size_t>(image_.face[index(column, row)]);
    std::array<Vector3d, 3> corner;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto v = static_cast<std::size_t>(scene_.mesh.face[3 * f + c]);
      corner[c] = Eigen::Map<const Eigen::Vector3f>(&scene_.mesh.vertex[3 * v]).cast<double>();
    }
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(rotation_.data());
    const Vector3d normal =
        rotation * (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
    const Vector3d ray = Vector3d((column - image_.camera.cx) / image_.camera.fx,
                                  (row - image_.camera.cy) / image_.camera.fy, 1.0)
                             .normalized();
    return std::abs(normal.dot(ray)) < std::cos(kDegree * params_.grazing);
  }

  const Scene& scene_;
  const SequenceParams& params_;
  std::array<double, 9> rotation_{};
  camera::DepthImage image_;
};

}  // namespace

Fields describe(SequenceParams& params) {
  constexpr double kTurns = 36000.0;
  return {integer_field("frames", params.frames, 1, 100000, "", "Clouds to make."),
          integer_field("width", params.width, 16, 4096, "px", "Columns of the image."),
          integer_field("height", params.height, 16, 4096, "px", "Rows of the image."),
          number_field("focal", params.focal, 1.0, 100000.0, "px", "Focal length."),
          number_field("object_height", params.object_height, 1e-3, 100.0, "m",
                       "From the object's lowest to its highest point."),
          number_field("distance", params.distance, 0.0, 1000.0, "m",
                       "From the camera to the object's middle; 0: the object fills the image."),
          number_field("start_azimuth", params.start_azimuth, -kTurns, kTurns, "deg",
                       "Of the first frame, about the vertical; 0: the camera is on the +x side."),
          number_field("end_azimuth", params.end_azimuth, -kTurns, kTurns, "deg",
                       "Of the frame after the last."),
          number_field("elevation", params.elevation, -90.0, 90.0, "deg", "Above the horizon."),
          number_field("baseline", params.baseline, 1e-3, 10.0, "m",
                       "Distance of the sensor's two eyes."),
          number_field("disparity_noise", params.disparity_noise, 0.0, 100.0, "px",
                       "Standard deviation of a measured disparity."),
          number_field("disparity_step", params.disparity_step, 0.0, 100.0, "px",
                       "Step of a measured disparity; 0: none."),
          number_field("grazing", params.grazing, 0.0, 90.0, "deg",
                       "Angle between ray and normal above which nothing is measured."),
          number_field(
              "edge_jump", params.edge_jump, 0.0, 1000.0, "",
              "Relative step of depth to a neighbour beyond which a pixel is missing; 0: none is."),
          number_field("dropout", params.dropout, 0.0, 1.0, "", "Pixels lost at random."),
          seed_field("seed", params.seed, "Of noise and lost pixels.")};
}

std::vector<Cloud> sequence(const Mesh& mesh, const SequenceParams& params) {
  const Scene scene = stage(mesh, params.object_height);
  const double distance =
      params.distance > 0.0 ? params.distance : fitting_distance(params, scene.radius);
  if (distance <= scene.radius)
    throw InputError("the camera would be inside the object's bounding sphere: distance " +
                     std::to_string(distance) + " m, radius " + std::to_string(scene.radius) +
                     " m");
  std::vector<Cloud> clouds;
  for (int frame = 0; frame < params.frames; ++frame) {
    Random random(derive_seed(params.seed, static_cast<std::uint64_t>(frame)));
    const Sensor sensor(scene, params, pose_of(params, distance, frame));
    clouds.push_back(to_cloud(sensor.measure(random), scene.mesh));
  }
  return clouds;
}

}  // namespace cosegraph::sample
