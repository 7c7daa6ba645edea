#include "core/cloud.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace cosegraph {
namespace {

void require(bool fine, const char* what) {
  if (!fine) throw InputError(what);
}

void check_labels(const std::vector<std::int32_t>& label, std::size_t expected,
                  const std::vector<std::string>& names, const char* what) {
  if (!label.empty() && label.size() != expected)
    throw InputError(std::to_string(label.size()) + " labels for " + std::to_string(expected) +
                     " " + what);
  require(label.empty() == names.empty(), "labels without names, or names without labels");
  const auto count = static_cast<std::int32_t>(names.size());
  for (const std::int32_t value : label)
    if (value < kNoLabel || value >= count)
      throw InputError("label " + std::to_string(value) + " has no name");
}

}  // namespace

void check_sizes(const Cloud& cloud) {
  require(cloud.xyz.size() % 3 == 0, "the number of coordinates is not a multiple of 3");
  const std::size_t size = cloud.size();
  require(cloud.normal.empty() || cloud.normal.size() == 3 * size, "normals do not fit points");
  require(cloud.rgb.empty() || cloud.rgb.size() == 3 * size, "colours do not fit points");
  require(cloud.dense_index.empty() || cloud.dense_index.size() == size,
          "dense_index does not fit points");
  require(std::size_t{cloud.width} * cloud.height == size,
          "width x height is not the number of points");
  check_labels(cloud.label, size, cloud.label_names, "points");
}

Cloud finite_points(const Cloud& cloud) {
  Cloud result{.label_names = cloud.label_names,
               .origin = cloud.origin,
               .scale = cloud.scale,
               .recipe = cloud.recipe,
               .frame_id = cloud.frame_id,
               .stamp = cloud.stamp};
  const auto copy_point = [](const std::vector<float>& from, std::size_t i,
                             std::vector<float>& to) {
    if (!from.empty()) to.insert(to.end(), &from[3 * i], &from[3 * i] + 3);
  };
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float* p = &cloud.xyz[3 * i];
    if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) continue;
    copy_point(cloud.xyz, i, result.xyz);
    copy_point(cloud.normal, i, result.normal);
    copy_point(cloud.rgb, i, result.rgb);
    if (!cloud.label.empty()) result.label.push_back(cloud.label[i]);
    if (!cloud.dense_index.empty()) result.dense_index.push_back(cloud.dense_index[i]);
  }
  result.width = static_cast<std::uint32_t>(result.size());
  return result;
}

void check_sizes(const Mesh& mesh) {
  require(mesh.vertex.size() % 3 == 0, "the number of coordinates is not a multiple of 3");
  require(mesh.face.size() % 3 == 0, "the number of face corners is not a multiple of 3");
  const auto count = static_cast<std::int32_t>(mesh.vertex_count());
  for (std::size_t i = 0; i < mesh.face.size(); ++i)
    if (mesh.face[i] < 0 || mesh.face[i] >= count)
      throw InputError("face " + std::to_string(i / 3) + " names vertex " +
                       std::to_string(mesh.face[i]) + " of " + std::to_string(count));
  check_labels(mesh.face_label, mesh.face_count(), mesh.label_names, "faces");
}

double surface_area(const Mesh& mesh) {
  const auto vertex = [&](std::size_t corner) -> Eigen::Vector3d {
    return Eigen::Map<const Eigen::Vector3f>(&mesh.vertex[3 * mesh.face[corner]]).cast<double>();
  };
  double area = 0.0;
  for (std::size_t f = 0; f < mesh.face_count(); ++f) {
    const Eigen::Vector3d a = vertex(3 * f);
    area += 0.5 * (vertex(3 * f + 1) - a).cross(vertex(3 * f + 2) - a).norm();
  }
  return area;
}

}  // namespace cosegraph
