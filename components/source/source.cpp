#include "source/source.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/nearest.hpp"
#include "source/extraction.hpp"
#include "source/grid.hpp"
#include "source/normals.hpp"

namespace cosegraph::source {
namespace {

using Indices = std::vector<std::int32_t>;

constexpr std::size_t kFewestPoints = 50;
constexpr std::size_t kMostDensePoints = 60000;

void require_enough(std::size_t count, const std::string& what) {
  if (count < kFewestPoints)
    throw InputError("only " + std::to_string(count) + " " + what + ", at least " +
                     std::to_string(kFewestPoints) + " are needed");
}

// Points so far out that nothing could be computed with them count as not finite.
Indices finite_indices(const Cloud& cloud) {
  Indices finite;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (std::all_of(&cloud.xyz[3 * i], &cloud.xyz[3 * i] + 3, NearestNeighbours::takes))
      finite.push_back(static_cast<std::int32_t>(i));
  return finite;
}

template <class T>
std::vector<T> gathered(const std::vector<T>& values, const Indices& points,
                        std::size_t dimension) {
  std::vector<T> result;
  if (values.empty()) return result;
  result.reserve(dimension * points.size());
  for (const std::int32_t i : points)
    result.insert(result.end(), &values[dimension * i], &values[dimension * i] + dimension);
  return result;
}

// The listed points of `cloud`, in that order, without normals.
Cloud selected(const Cloud& cloud, const Indices& points) {
  Cloud result{.label_names = cloud.label_names, .origin = cloud.origin};
  result.xyz = gathered(cloud.xyz, points, 3);
  result.rgb = gathered(cloud.rgb, points, 3);
  result.label = gathered(cloud.label, points, 1);
  result.width = static_cast<std::uint32_t>(points.size());
  return result;
}

// Per cell the most frequent label, kNoLabel only if no point has one; ties: the smaller.
Indices majority_labels(const Indices& label, const Cells& cells) {
  std::vector<std::pair<std::int32_t, std::int32_t>> votes;  // cell, label
  votes.reserve(label.size());
  for (std::size_t i = 0; i < label.size(); ++i)
    if (label[i] != kNoLabel) votes.emplace_back(cells.of_point[i], label[i]);
  std::ranges::sort(votes);
  Indices majority(cells.count, kNoLabel);
  std::vector<std::ptrdiff_t> most(cells.count, 0);
  for (auto begin = votes.begin(); begin != votes.end();) {
    const auto end = std::upper_bound(begin, votes.end(), *begin);
    const std::int32_t cell = begin->first;
    if (end - begin > most[cell]) {
      most[cell] = end - begin;
      majority[cell] = begin->second;
    }
    begin = end;
  }
  return majority;
}

// One mean point per cell.
Cloud reduced(const Cloud& cloud, const Cells& cells) {
  Cloud result{.label_names = cloud.label_names, .origin = cloud.origin};
  result.xyz = cell_means(cloud.xyz, cells);
  if (!cloud.rgb.empty()) result.rgb = cell_means(cloud.rgb, cells);
  if (!cloud.label.empty()) result.label = majority_labels(cloud.label, cells);
  result.width = static_cast<std::uint32_t>(cells.count);
  return result;
}

// Per cell the member nearest to the cell's mean point; ties: the first.
Indices representatives(const Cloud& members, const Cells& cells, const Cloud& means) {
  Indices nearest(cells.count, kNoPoint);
  std::vector<float> distance(cells.count, std::numeric_limits<float>::max());
  for (std::size_t i = 0; i < members.size(); ++i) {
    const std::int32_t cell = cells.of_point[i];
    float squared = 0.0F;
    for (int axis = 0; axis < 3; ++axis) {
      const float step = members.xyz[3 * i + axis] - means.xyz[3 * cell + axis];
      squared += step * step;
    }
    if (squared < distance[cell]) {
      distance[cell] = squared;
      nearest[cell] = static_cast<std::int32_t>(i);
    }
  }
  return nearest;
}

// Tells when a cloud has more points than the dense cloud may have, or too many cells.
void note_reduction(std::size_t points, const Cells& cells, double finest,
                    std::vector<std::string>& notes) {
  const bool grew = cells.size > finest;
  if (!grew && points <= kMostDensePoints) return;
  std::string note = std::to_string(points) + " points reduced to " + std::to_string(cells.count);
  if (grew)
    note += ": the dense spacing grew from " + std::to_string(finest) + " to " +
            std::to_string(cells.size);
  notes.push_back(std::move(note));
}

}  // namespace

Fields describe(Params& params) {
  return {
      choice_field("scale_rule", params.scale_rule,
                   "How the length of one scale is estimated from the visible points."),
      number_field("dense_spacing", params.dense_spacing, 1e-4, 1.0, "scale",
                   "Finest spacing of the dense cloud, which feeds the supervoxels."),
      number_field("spacing", params.spacing, 1e-4, 1.0, "scale",
                   "Voxel of the sparse cloud, which feeds descriptors and spectra."),
      number_field("normal_radius", params.normal_radius, 1e-4, 1.0, "scale",
                   "Neighbourhood whose principal components give a normal."),
  };
}

Fields describe(Extraction& extraction) {
  const auto check_number = [](const std::string& text) {
    double value = 0.0;
    number_field("crop", value, -1e9, 1e9, "m", "").set({text});
  };
  return {
      boolean_field("enabled", extraction.enabled,
                    "Cut the object out of the scene; off: all finite points are the object."),
      list_field("crop", extraction.crop,
                 "Box xmin ymin zmin xmax ymax zmax in metres outside of which points go.",
                 check_number),
      integer_field("outlier_neighbours", extraction.outlier_neighbours, 0, 1000, "",
                    "Neighbours of the statistical outlier removal; 0: none."),
      number_field("outlier_sigma", extraction.outlier_sigma, 0.0, 100.0, "",
                   "Points farther from their neighbours than mean + sigma deviations go."),
      number_field("plane_tolerance", extraction.plane_tolerance, 0.0, 10.0, "m",
                   "Distance to the dominant plane at which points go with it; 0: it stays."),
      boolean_field("standing", extraction.standing,
                    "Keep only what stands on the plane: above it, over its outline."),
      number_field("cluster_tolerance", extraction.cluster_tolerance, 0.0, 100.0, "m",
                   "Gap that separates Euclidean clusters; 0: all points are one."),
      integer_field("cluster", extraction.cluster, 0, 1000000, "",
                    "Which cluster is the object, 0 = the largest."),
  };
}

Frame prepare(Cloud input, const Extraction& extraction, const Params& params) {
  check_sizes(input);
  Frame frame;
  Indices kept = finite_indices(input);
  require_enough(kept.size(), "points are finite");
  if (extraction.enabled) {
    const Indices object = object_points(gathered(input.xyz, kept, 3), extraction, frame.notes);
    kept = gathered(kept, object, 1);
    require_enough(kept.size(), "points are left after the extraction");
  }
  const Cloud object = selected(input, kept);
  const double scale = estimate_scale(object.xyz, params.scale_rule);

  const double finest = params.dense_spacing * scale;
  const Cells dense_cells = group_by_cell(object.xyz, finest, kMostDensePoints);
  note_reduction(kept.size(), dense_cells, finest, frame.notes);
  frame.dense = reduced(object, dense_cells);

  const Cells cells = group_by_cell(frame.dense.xyz, params.spacing * scale);
  frame.cloud = reduced(frame.dense, cells);
  require_enough(frame.cloud.size(), "points are left after the reduction (is the scale right?)");
  frame.cloud.dense_index = representatives(frame.dense, cells, frame.cloud);
  frame.cloud.normal =
      estimate_normals(frame.cloud.xyz, params.normal_radius * scale, input.origin);

  frame.input = std::move(input);
  frame.input.dense_index.assign(frame.input.size(), kNoPoint);
  for (std::size_t i = 0; i < kept.size(); ++i)
    frame.input.dense_index[kept[i]] = dense_cells.of_point[i];
  Params copy = params;
  for (Cloud* cloud : {&frame.input, &frame.dense, &frame.cloud}) {
    cloud->scale = static_cast<float>(scale);
    cloud->recipe = recipe(describe(copy));
  }
  return frame;
}

}  // namespace cosegraph::source

template <>
cosegraph::Names<cosegraph::source::ScaleRule> cosegraph::names<cosegraph::source::ScaleRule>() {
  using cosegraph::source::ScaleRule;
  static constexpr std::pair<ScaleRule, std::string_view> table[] = {
      {ScaleRule::area, "area"}, {ScaleRule::extent, "extent"}, {ScaleRule::fixed, "fixed"}};
  return table;
}
