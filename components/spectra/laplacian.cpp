#include "spectra/laplacian.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/nearest.hpp"

namespace cosegraph::spectra {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Index = std::int32_t;

Vector3d point(std::span<const double> xyz, Index i) {
  return Eigen::Map<const Vector3d>(&xyz[3 * static_cast<std::size_t>(i)]);
}

// The `count` nearest points of every point, itself first.
std::vector<std::vector<Index>> patches(std::span<const double> xyz, int count) {
  const std::vector<float> single(xyz.begin(), xyz.end());
  const NearestNeighbours near(single);
  std::vector<std::vector<Index>> result(xyz.size() / 3);
  for (std::size_t i = 0; i < result.size(); ++i) {
    const auto self = static_cast<Index>(i);
    result[i].push_back(self);
    for (const auto& found : near.nearest(&single[3 * i], static_cast<std::size_t>(count)))
      if (found.index != self) result[i].push_back(found.index);
  }
  return result;
}

// Columns: two tangents and the normal of a patch, its principal axes.
Matrix3d frame_of(std::span<const double> xyz, const std::vector<Index>& patch) {
  Vector3d mean = Vector3d::Zero();
  for (const Index i : patch) mean += point(xyz, i);
  mean /= static_cast<double>(patch.size());
  Matrix3d covariance = Matrix3d::Zero();
  for (const Index i : patch) {
    const Vector3d offset = point(xyz, i) - mean;
    covariance += offset * offset.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Matrix3d> axes;
  axes.computeDirect(covariance);
  return axes.eigenvectors().rowwise().reverse();  // ascending eigenvalues: the normal comes last
}

double cross(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// The star of the origin in the Delaunay triangulation of the origin and `plane`: consecutive
// pairs of its neighbours, counter-clockwise. The Voronoi cell of the origin is dual to the convex
// hull of the points p / |p|^2; where the origin itself is on that hull the cell is open and the
// star has a gap.
std::vector<std::array<Index, 2>> delaunay_star(const std::vector<Vector2d>& plane) {
  constexpr Index kOrigin = -1;
  struct Dual {
    Vector2d at;
    Index index;
  };
  std::vector<Dual> dual{{Vector2d::Zero(), kOrigin}};
  double widest = 0.0;
  for (const auto& p : plane) widest = std::max(widest, p.squaredNorm());
  for (std::size_t i = 0; i < plane.size(); ++i)
    if (const double square = plane[i].squaredNorm(); square > 1e-10 * widest)
      dual.push_back({plane[i] / square, static_cast<Index>(i)});
  std::ranges::sort(dual, [](const Dual& a, const Dual& b) {
    return std::make_tuple(a.at.x(), a.at.y(), a.index) <
           std::make_tuple(b.at.x(), b.at.y(), b.index);
  });

  std::vector<Dual> hull;  // monotone chain: lower hull, then upper hull, counter-clockwise
  const auto extend = [&hull](const Dual& next, std::size_t fixed) {
    while (hull.size() > fixed &&
           cross(hull.back().at - hull[hull.size() - 2].at, next.at - hull.back().at) <= 0.0)
      hull.pop_back();
    hull.push_back(next);
  };
  for (const auto& next : dual) extend(next, 1);
  const std::size_t lower = hull.size();
  for (std::size_t i = dual.size() - 1; i-- > 0;) extend(dual[i], lower);

  std::vector<std::array<Index, 2>> star;
  for (std::size_t i = 0; i + 1 < hull.size(); ++i)
    if (hull[i].index != kOrigin && hull[i + 1].index != kOrigin)
      star.push_back({hull[i].index, hull[i + 1].index});
  return star;
}

struct Triangle {
  std::array<Index, 3> corner;
  std::array<double, 3> cotangent;  // of the angle at each corner
  double area;
};

// A triangle without area is returned with area 0.
Triangle make_triangle(std::span<const double> xyz, std::array<Index, 3> corner) {
  std::array<Vector3d, 3> side;  // opposite to each corner
  for (std::size_t c = 0; c < 3; ++c)
    side[c] = point(xyz, corner[(c + 2) % 3]) - point(xyz, corner[(c + 1) % 3]);
  const double twice = side[0].cross(side[1]).norm();
  const double longest = std::max({side[0].norm(), side[1].norm(), side[2].norm()});
  Triangle result{corner, {}, 0.0};
  if (twice <= 1e-9 * longest * longest) return result;
  for (std::size_t c = 0; c < 3; ++c)
    result.cotangent[c] = -side[(c + 1) % 3].dot(side[(c + 2) % 3]) / twice;
  result.area = 0.5 * twice;
  return result;
}

std::vector<Triangle> one_ring_triangles(std::span<const double> xyz, int neighbours) {
  std::vector<Triangle> result;
  std::vector<Vector2d> plane;
  for (const auto& patch : patches(xyz, neighbours)) {
    const Eigen::Matrix<double, 3, 2> tangents = frame_of(xyz, patch).leftCols<2>();
    const Vector3d centre = point(xyz, patch[0]);
    plane.clear();
    for (std::size_t n = 1; n < patch.size(); ++n)
      plane.push_back(tangents.transpose() * (point(xyz, patch[n]) - centre));
    for (const auto& [a, b] : delaunay_star(plane)) {
      const Triangle triangle =
          make_triangle(xyz, {patch[0], patch[static_cast<std::size_t>(a) + 1],
                              patch[static_cast<std::size_t>(b) + 1]});
      if (triangle.area > 0.0) result.push_back(triangle);
    }
  }
  return result;
}

class Pieces {
 public:
  explicit Pieces(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  Index find(Index i) {
    while (parent_[at(i)] != i) i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }
  void join(Index a, Index b) {
    std::tie(a, b) = std::minmax({find(a), find(b)});
    parent_[at(b)] = a;
  }

 private:
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
  std::vector<Index> parent_;  // never larger than the point itself
};

std::vector<Index> numbered(Pieces& pieces, std::size_t count) {
  std::vector<Index> result(count);
  Index next = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto root = static_cast<std::size_t>(pieces.find(static_cast<Index>(i)));
    result[i] = root == i ? next++ : result[root];
  }
  return result;
}

using Edge = WeakLaplacian::Edge;

void sort_and_merge(std::vector<Edge>& edges) {
  std::ranges::stable_sort(
      edges, [](const Edge& a, const Edge& b) { return std::tie(a.a, a.b) < std::tie(b.a, b.b); });
  std::size_t count = 0;
  for (const auto& edge : edges)
    if (count > 0 && edges[count - 1].a == edge.a && edges[count - 1].b == edge.b)
      edges[count - 1].weight += edge.weight;
    else
      edges[count++] = edge;
  edges.resize(count);
}

void fill_empty_masses(std::vector<double>& mass) {
  const double sum = std::accumulate(mass.begin(), mass.end(), 0.0);
  const auto filled = std::ranges::count_if(mass, [](double m) { return m > 0.0; });
  const double mean = filled > 0 ? sum / static_cast<double>(filled) : 1.0;
  std::ranges::replace(mass, 0.0, mean);
}

// -Lap f at a patch's first point, one coefficient per point of the patch.
Eigen::RowVectorXd mls_row(std::span<const double> xyz, const std::vector<Index>& patch) {
  const Matrix3d frame = frame_of(xyz, patch);
  const Vector3d centre = point(xyz, patch[0]);
  const auto count = static_cast<Eigen::Index>(patch.size());
  Eigen::Matrix<double, Eigen::Dynamic, 6> basis(count, 6);
  Eigen::VectorXd height(count);
  Eigen::VectorXd weight = Eigen::VectorXd::Constant(count, 1.0 / static_cast<double>(count));
  weight[0] = 1.0;
  for (Eigen::Index n = 0; n < count; ++n) {
    const Vector3d local =
        frame.transpose() * (point(xyz, patch[static_cast<std::size_t>(n)]) - centre);
    const double x = local.x();
    const double y = local.y();
    basis.row(n) << 1.0, x, y, x * x, x * y, y * y;
    height[n] = local.z();
  }
  const Eigen::Matrix<double, 6, Eigen::Dynamic> weighted = basis.transpose() * weight.asDiagonal();
  const Eigen::Matrix<double, 6, 6> normal_matrix = weighted * basis;
  const Eigen::Matrix<double, 6, Eigen::Dynamic> fit = normal_matrix.fullPivLu().solve(weighted);

  const Eigen::Matrix<double, 6, 1> a = fit * height;
  const double zx = a[1];
  const double zy = a[2];
  const double g = 1.0 + zx * zx + zy * zy;
  const double g11 = (1.0 + zy * zy) / g;
  const double g12 = -zx * zy / g;
  const double g22 = (1.0 + zx * zx) / g;
  const double curvature = (2.0 * g11 * a[3] + 2.0 * g12 * a[4] + 2.0 * g22 * a[5]) / g;
  return -(2.0 * g11 * fit.row(3) + 2.0 * g12 * fit.row(4) + 2.0 * g22 * fit.row(5)) +
         curvature * (zx * fit.row(1) + zy * fit.row(2));
}

}  // namespace

WeakLaplacian weak_laplacian(std::span<const double> xyz, int neighbours) {
  constexpr double kThird = 1.0 / 3.0;
  const auto triangles = one_ring_triangles(xyz, neighbours);
  WeakLaplacian result;
  result.mass.assign(xyz.size() / 3, 0.0);
  Pieces pieces(result.mass.size());
  for (const auto& triangle : triangles)
    for (std::size_t c = 0; c < 3; ++c) {
      const auto [a, b] = std::minmax({triangle.corner[(c + 1) % 3], triangle.corner[(c + 2) % 3]});
      result.edge.push_back({a, b, kThird * 0.5 * triangle.cotangent[c]});
      result.mass[static_cast<std::size_t>(triangle.corner[c])] += kThird * kThird * triangle.area;
      pieces.join(a, b);
    }
  sort_and_merge(result.edge);
  fill_empty_masses(result.mass);
  result.component = numbered(pieces, result.mass.size());
  return result;
}

void add_bridges(std::span<const double> xyz, double bridge, WeakLaplacian& laplacian) {
  const std::size_t count = laplacian.mass.size();
  const auto& component = laplacian.component;
  if (count == 0 || *std::ranges::max_element(component) == 0) return;
  std::vector<std::vector<Index>> members(count);
  for (std::size_t i = 0; i < count; ++i)
    members[static_cast<std::size_t>(component[i])].push_back(static_cast<Index>(i));

  constexpr double kFar = std::numeric_limits<double>::infinity();
  struct Link {
    double square = kFar;  // distance to the joined pieces; -1 once joined itself
    Index from = 0;
  };
  std::vector<Link> link(count);
  const auto join = [&](Index piece) {
    const auto& points = members[static_cast<std::size_t>(piece)];
    for (const Index i : points) link[static_cast<std::size_t>(i)].square = -1.0;
    for (std::size_t j = 0; j < count; ++j) {
      if (link[j].square < 0.0) continue;
      for (const Index i : points) {
        const double square = (point(xyz, i) - point(xyz, static_cast<Index>(j))).squaredNorm();
        if (square < link[j].square) link[j] = {square, i};
      }
    }
  };
  join(component[0]);
  while (true) {
    std::size_t nearest = count;
    for (std::size_t j = 0; j < count; ++j)
      if (link[j].square >= 0.0 && (nearest == count || link[j].square < link[nearest].square))
        nearest = j;
    if (nearest == count) break;
    const auto [a, b] = std::minmax({static_cast<Index>(nearest), link[nearest].from});
    laplacian.edge.push_back({a, b, bridge});
    join(component[nearest]);
  }
  sort_and_merge(laplacian.edge);
}

StrongLaplacian mls_laplacian(std::span<const double> xyz, int neighbours) {
  StrongLaplacian result;
  for (const auto& patch : patches(xyz, neighbours)) {
    const Eigen::RowVectorXd row = mls_row(xyz, patch);
    for (std::size_t n = 0; n < patch.size(); ++n)
      result.entry.push_back({patch[0], patch[n], row[static_cast<Eigen::Index>(n)]});
  }
  return result;
}

}  // namespace cosegraph::spectra
