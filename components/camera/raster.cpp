#include "camera/raster.hpp"

#include <limits>

namespace cosegraph::camera {

Raster::Raster(const Mesh& mesh, const Pinhole& camera, const Pose& pose)
    : mesh_(&mesh), camera_(camera), points_(mesh.vertex_count()) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(
      pose.rotation.data());
  const Eigen::Map<const Eigen::Vector3d> translation(pose.translation.data());
  for (std::size_t v = 0; v < points_.size(); ++v) {
    const Eigen::Map<const Eigen::Vector3f> vertex(&mesh.vertex[3 * v]);
    points_[v] = rotation * vertex.cast<double>() + translation;
  }
}

DepthImage Raster::draw() const {
  const std::size_t pixels = std::size_t{camera_.width} * camera_.height;
  DepthImage image{.camera = camera_,
                   .depth = std::vector<double>(pixels, std::numeric_limits<double>::infinity()),
                   .face = std::vector<std::int32_t>(pixels, -1)};
  const auto label = [&](std::int32_t f) {
    return mesh_->face_label.empty() ? kNoLabel : mesh_->face_label[static_cast<std::size_t>(f)];
  };
  for (std::size_t f = 0; f < mesh_->face_count(); ++f) {
    const auto face = static_cast<std::int32_t>(f);
    for_each_pixel(f, [&](std::size_t pixel, double depth) {
      double& nearest = image.depth[pixel];
      if (depth > nearest) return;
      if (depth == nearest && label(face) >= label(image.face[pixel])) return;
      nearest = depth;
      image.face[pixel] = face;
    });
  }
  return image;
}

}  // namespace cosegraph::camera
