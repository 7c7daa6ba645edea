// Discrete Laplace-Beltrami operators on scattered points of a surface, as plain arrays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cosegraph::spectra {

// Symmetric weak form: (L f)_i = sum over edges {i, j} of weight (f_i - f_j), mass on the diagonal.
struct WeakLaplacian {
  struct Edge {
    std::int32_t a, b;  // a < b
    double weight;
  };
  std::vector<Edge> edge;               // sorted, unique
  std::vector<double> mass;             // per point: area that it stands for, > 0
  std::vector<std::int32_t> component;  // per point: piece of the surface, 0, 1, .. by first point
};

// Each point's one-ring is the star of the point in the Delaunay triangulation of its `neighbours`
// nearest points, projected to their common tangent plane; lengths and angles are those of the 3-D
// triangles. Every triangle is weighted 1/3, since each of its corners may hold it. The stiffness
// is a sum of positive semidefinite triangle matrices and therefore positive semidefinite itself,
// although single cotangent sums may be negative: they are kept, as clamping them would no longer
// reproduce linear functions. The boundary condition is Neumann's.
//
// Holes narrower than a neighbourhood are spanned, on purpose: leaving out triangles with a wide
// circumcircle tore thin parts off and made the part relations of real views worse. A point
// without triangles gets the mean mass.
WeakLaplacian weak_laplacian(std::span<const double> xyz, int neighbours);

// Joins the pieces of `laplacian` into one by edges of weight `bridge`: starting at the piece of
// point 0, always the nearest point of another piece next (a minimum spanning tree of pieces).
// `component` stays as it is.
void add_bridges(std::span<const double> xyz, double bridge, WeakLaplacian& laplacian);

// Strong form: row i of -Lap by moving least squares (Liang et al., CVPR 2012), not symmetric.
struct StrongLaplacian {
  struct Entry {
    std::int32_t row, column;
    double value;
  };
  std::vector<Entry> entry;  // by rows
};

StrongLaplacian mls_laplacian(std::span<const double> xyz, int neighbours);

}  // namespace cosegraph::spectra
