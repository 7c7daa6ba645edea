#include "camera/camera.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "camera/raster.hpp"
#include "core/error.hpp"
#include "core/random.hpp"

namespace cosegraph::camera {
namespace {

using Direction = std::array<double, 3>;

// Distance of rays for measuring visible area, in sqrt(surface area). Over the benchmark the error
// of a part's visible fraction is .008 on average with it (.020 at .01, .006 at .0025).
constexpr double kVisibilityPitch = 0.004;

// How much finer the directions are when too few of them are valid.
constexpr int kFiner = 4;

Eigen::Vector3d to_eigen(const Direction& v) {
  return {v[0], v[1], v[2]};
}
Direction to_array(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

// Where an object is and how large: the middle of the box around its faces, the distance of its
// farthest corner from there, the square root of its area.
struct Frame {
  Eigen::Vector3d middle;
  double radius;
  double scale;
};

Frame frame_of(const Mesh& mesh) {
  check_sizes(mesh);
  const auto corner = [&](std::int32_t v) -> Eigen::Vector3d {
    return Eigen::Map<const Eigen::Vector3f>(&mesh.vertex[3 * static_cast<std::size_t>(v)])
        .cast<double>();
  };
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  for (const std::int32_t v : mesh.face) {
    low = low.cwiseMin(corner(v));
    high = high.cwiseMax(corner(v));
  }
  Frame frame{.middle = 0.5 * (low + high), .radius = 0.0, .scale = std::sqrt(surface_area(mesh))};
  for (const std::int32_t v : mesh.face)
    frame.radius = std::max(frame.radius, (corner(v) - frame.middle).norm());
  if (!(frame.scale > 0.0) || !std::isfinite(frame.scale) || !std::isfinite(frame.radius))
    throw InputError("the mesh has no surface, or coordinates that are not finite");
  return frame;
}

Pose pose_of(const Frame& frame, const Direction& direction, double roll, const Params& params) {
  const Eigen::Vector3d toward = to_eigen(direction).normalized();
  if (!toward.allFinite() || toward.isZero()) throw InputError("a view needs a direction");
  const Eigen::Vector3d eye = frame.middle + params.distance * frame.radius * toward;
  return look_at(to_array(eye), to_array(frame.middle), roll);
}

// A square image of the object's bounding sphere; `pitch` is the distance of rays in the middle.
Pinhole pinhole_of(const Frame& frame, double pitch, const Params& params) {
  const double focal = params.distance * frame.radius / (pitch * frame.scale);
  // The sphere's outline is a circle with this tangent about the optical axis.
  const double outline = 1.0 / std::sqrt(params.distance * params.distance - 1.0);
  const double size = 2.0 * std::ceil(focal * outline) + 1.0;
  constexpr double kLargestSize = 8192.0;
  if (size > kLargestSize)
    throw InputError("the mesh is too thin for rays " + std::to_string(pitch) +
                     " sqrt(area) apart: its image would be " + std::to_string(size) +
                     " pixels wide");
  const double centre = 0.5 * (size - 1.0);
  const auto pixels = static_cast<std::uint32_t>(size);
  return {.width = pixels, .height = pixels, .fx = focal, .fy = focal, .cx = centre, .cy = centre};
}

// Area per label, and how much of it is seen.
struct PartAreas {
  std::vector<double> total;
  std::vector<double> visible;
};

std::vector<double> total_areas(const Mesh& mesh) {
  std::vector<double> total(mesh.label_names.size());
  const Raster raster(mesh, {}, {});
  for (std::size_t f = 0; f < mesh.face_label.size(); ++f)
    if (mesh.face_label[f] != kNoLabel)
      total[static_cast<std::size_t>(mesh.face_label[f])] += raster.area(f);
  return total;
}

// Each ray counts for the surface around the point that it hits first. A face is hit by as many
// rays as its size demands, so the sum is right on average for faces of any size, also for those
// that are far smaller than a pixel.
std::vector<double> fractions(const Mesh& mesh, const Frame& frame,
                              const std::vector<double>& total, const Direction& direction,
                              const Params& params) {
  std::vector<double> visible(total.size());
  if (mesh.face_label.empty()) return visible;
  const Raster raster(mesh, pinhole_of(frame, kVisibilityPitch, params),
                      pose_of(frame, direction, 0.0, params));
  const DepthImage image = raster.draw();
  for (std::size_t pixel = 0; pixel < image.face.size(); ++pixel) {
    if (image.face[pixel] < 0) continue;
    const auto f = static_cast<std::size_t>(image.face[pixel]);
    if (mesh.face_label[f] != kNoLabel)
      visible[static_cast<std::size_t>(mesh.face_label[f])] +=
          raster.footprint(f, image.depth[pixel]);
  }
  for (std::size_t l = 0; l < total.size(); ++l)
    visible[l] = total[l] > 0.0 ? std::min(visible[l] / total[l], 1.0) : 0.0;
  return visible;
}

// Indices of the valid ones of `directions`, ascending.
std::vector<std::size_t> valid_directions(const Mesh& mesh, const Frame& frame,
                                          const std::vector<Direction>& directions,
                                          const Params& params) {
  const std::vector<double> total = total_areas(mesh);
  std::vector<std::size_t> valid;
  for (std::size_t d = 0; d < directions.size(); ++d) {
    const auto visible = fractions(mesh, frame, total, directions[d], params);
    bool all = true;
    for (std::size_t l = 0; l < total.size(); ++l)
      all = all && (total[l] == 0.0 || visible[l] >= params.visible);
    if (all) valid.push_back(d);
  }
  return valid;
}

// Up to `count` of `candidates`: the first at random, then always the one farthest from those
// taken; ties by order.
std::vector<std::size_t> spread(const std::vector<Direction>& directions,
                                const std::vector<std::size_t>& candidates, std::size_t count,
                                std::uint64_t seed) {
  std::vector<std::size_t> taken;
  if (candidates.empty()) return taken;
  // Cosine to the nearest direction taken so far.
  std::vector<double> nearness(candidates.size(), -2.0);
  std::size_t next = Random(seed).below(candidates.size());
  while (taken.size() < std::min(count, candidates.size())) {
    const Eigen::Vector3d latest = to_eigen(directions[candidates[next]]);
    taken.push_back(candidates[next]);
    for (std::size_t c = 0; c < candidates.size(); ++c)
      nearness[c] = std::max(nearness[c], to_eigen(directions[candidates[c]]).dot(latest));
    nearness[next] = std::numeric_limits<double>::infinity();
    next = static_cast<std::size_t>(std::min_element(nearness.begin(), nearness.end()) -
                                    nearness.begin());
  }
  return taken;
}

}  // namespace

Fields describe(Params& params) {
  constexpr int kMostDirections = 10000;
  return {number_field("pitch", params.pitch, 0.0005, 0.1, "sqrt(area)",
                       "Distance of neighbouring rays in the middle of the object."),
          number_field("distance", params.distance, 1.1, 100.0, "bounding radii",
                       "From the sensor to the middle of the object."),
          integer_field("directions", params.directions, 1, kMostDirections, "",
                        "Directions that are tried for views."),
          number_field("visible", params.visible, 0.0, 1.0, "",
                       "Fraction of the area of each part that a valid view shows."),
          integer_field("count", params.count, 1, kMostDirections, "", "Views that are chosen."),
          seed_field("seed", params.seed,
                     "Of the roll about the optical axis and the first view chosen.")};
}

Pose look_at(const Direction& eye, const Direction& target, double roll) {
  const Eigen::Vector3d z = (to_eigen(target) - to_eigen(eye)).normalized();
  constexpr double kNearlyUpright = 0.9999;
  const Eigen::Vector3d up =
      std::abs(z.z()) < kNearlyUpright ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY();
  const Eigen::Vector3d right = z.cross(up).normalized();
  const Eigen::Vector3d down = z.cross(right);
  Pose pose;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(pose.rotation.data());
  rotation.row(0) = std::cos(roll) * right + std::sin(roll) * down;
  rotation.row(1) = std::cos(roll) * down - std::sin(roll) * right;
  rotation.row(2) = z;
  Eigen::Map<Eigen::Vector3d>(pose.translation.data()) = -(rotation * to_eigen(eye));
  return pose;
}

DepthImage cast(const Mesh& mesh, const Pinhole& camera, const Pose& pose) {
  check_sizes(mesh);
  if (!(camera.fx > 0.0) || !(camera.fy > 0.0) || camera.width == 0 || camera.height == 0)
    throw InputError("a camera needs pixels and positive focal lengths");
  return Raster(mesh, camera, pose).draw();
}

Cloud to_cloud(const DepthImage& image, const Mesh& mesh) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const Pinhole& camera = image.camera;
  Cloud cloud;
  cloud.width = camera.width;
  cloud.height = camera.height;
  cloud.xyz.assign(3 * image.depth.size(), kNan);
  if (!mesh.face_label.empty()) {
    cloud.label.assign(image.depth.size(), kNoLabel);
    cloud.label_names = mesh.label_names;
  }
  for (std::size_t pixel = 0; pixel < image.depth.size(); ++pixel) {
    if (image.face[pixel] < 0) continue;
    const double z = image.depth[pixel];
    const std::size_t column = pixel % camera.width;
    const std::size_t row = pixel / camera.width;
    cloud.xyz[3 * pixel] =
        static_cast<float>((static_cast<double>(column) - camera.cx) / camera.fx * z);
    cloud.xyz[3 * pixel + 1] =
        static_cast<float>((static_cast<double>(row) - camera.cy) / camera.fy * z);
    cloud.xyz[3 * pixel + 2] = static_cast<float>(z);
    if (!cloud.label.empty())
      cloud.label[pixel] = mesh.face_label[static_cast<std::size_t>(image.face[pixel])];
  }
  return cloud;
}

std::vector<Direction> fibonacci_directions(int count) {
  const double golden_angle = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<Direction> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double radius = std::sqrt(1.0 - z * z);
    directions.push_back(
        {radius * std::cos(golden_angle * i), radius * std::sin(golden_angle * i), z});
  }
  return directions;
}

Cloud render(const Mesh& mesh, const Direction& direction, double roll, const Params& params) {
  const Frame frame = frame_of(mesh);
  const Raster raster(mesh, pinhole_of(frame, params.pitch, params),
                      pose_of(frame, direction, roll, params));
  return to_cloud(raster.draw(), mesh);
}

std::vector<double> visible_fractions(const Mesh& mesh, const Direction& direction,
                                      const Params& params) {
  return fractions(mesh, frame_of(mesh), total_areas(mesh), direction, params);
}

std::vector<View> choose_views(const Mesh& mesh, const Params& params) {
  const Frame frame = frame_of(mesh);
  const auto count = static_cast<std::size_t>(params.count);
  std::vector<Direction> directions = fibonacci_directions(params.directions);
  std::vector<std::size_t> valid = valid_directions(mesh, frame, directions, params);
  if (valid.size() < count) {
    directions = fibonacci_directions(kFiner * params.directions);
    valid = valid_directions(mesh, frame, directions, params);
  }
  std::vector<View> views;
  for (const std::size_t d : spread(directions, valid, count, params.seed)) {
    Random random(derive_seed(params.seed, d));
    views.push_back({directions[d], random.uniform(0.0, 2.0 * std::numbers::pi)});
  }
  return views;
}

}  // namespace cosegraph::camera
