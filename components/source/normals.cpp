#include "source/normals.hpp"

#include <Eigen/Dense>

#include "core/nearest.hpp"

namespace cosegraph::source {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kFewest = 8;
constexpr double kLine = 1e-6;  // second by largest variance below which points are a line

Vector3d vector_at(const float* p) {
  return Eigen::Map<const Eigen::Vector3f>(p).cast<double>();
}

template <class Neighbours>
Matrix3d scatter(const Neighbours& neighbours, std::span<const float> xyz, const Vector3d& origin) {
  Vector3d sum = Vector3d::Zero();
  Matrix3d products = Matrix3d::Zero();
  for (const auto& neighbour : neighbours) {
    const Vector3d offset = vector_at(&xyz[3 * neighbour.index]) - origin;
    sum += offset;
    products += offset * offset.transpose();
  }
  return products - sum * sum.transpose() / static_cast<double>(neighbours.size());
}

Vector3d normal_of(const Matrix3d& scatter, const Vector3d& view) {
  Eigen::SelfAdjointEigenSolver<Matrix3d> solver(scatter);
  const Vector3d& variance = solver.eigenvalues();
  Vector3d normal = solver.eigenvectors().col(0);
  if (!(variance[1] > kLine * variance[2])) {
    Vector3d along = Vector3d::Zero();
    if (variance[2] > 0.0) along = solver.eigenvectors().col(2);
    const Vector3d across = view - along * along.dot(view);
    if (across.norm() > 1e-9 * view.norm()) normal = across.normalized();
  }
  return normal.dot(view) < 0.0 ? Vector3d(-normal) : normal;
}

}  // namespace

std::vector<float> estimate_normals(std::span<const float> xyz, double radius,
                                    const std::array<float, 3>& sensor) {
  const NearestNeighbours tree(xyz);
  std::vector<float> normals(xyz.size());
  for (std::size_t i = 0; i < xyz.size(); i += 3) {
    auto neighbours = tree.within(&xyz[i], static_cast<float>(radius));
    if (neighbours.size() < kFewest) neighbours = tree.nearest(&xyz[i], kFewest);
    const Vector3d point = vector_at(&xyz[i]);
    const Vector3d normal =
        normal_of(scatter(neighbours, xyz, point), vector_at(sensor.data()) - point);
    Eigen::Map<Eigen::Vector3f>{&normals[i]} = normal.cast<float>();
  }
  return normals;
}

}  // namespace cosegraph::source
