#include "cpc/cpc.hpp"

#include <pcl/point_types.h>
#include <pcl/segmentation/cpc_segmentation.h>
#include <pcl/segmentation/supervoxel_clustering.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>

#include "cpc/boundary.hpp"
#include "pcl_console/pcl_console.hpp"

namespace cosegraph::cpc {
namespace {

using Point = pcl::PointXYZRGBA;
using Clusters = std::map<std::uint32_t, pcl::Supervoxel<Point>::Ptr>;
using Neighbours = std::multimap<std::uint32_t, std::uint32_t>;

constexpr std::int32_t kMostSupervoxels = 1 << 15;  // merging takes time with their square
constexpr float kWidest = 1e6F;  // of the supervoxels' distances, in seed distances

void require(bool condition, const std::string& what) {
  if (!condition) throw InputError("supervoxels: " + what);
}

void check(const Supervoxels& supervoxels) {
  const auto count = static_cast<std::int32_t>(supervoxels.count());
  const auto known = [count](std::int32_t id) { return id >= 0 && id < count; };
  const auto finite = [](float value) { return std::isfinite(value); };
  require(count > 0, "there are none");
  require(count <= kMostSupervoxels, "there are " + std::to_string(count) + ", at most " +
                                         std::to_string(kMostSupervoxels) + " are cut");
  require(supervoxels.normal.size() == supervoxels.centroid.size(),
          "the numbers of centroids and normals differ");
  require(std::ranges::all_of(supervoxels.centroid, finite), "a centroid is not finite");
  require(std::ranges::all_of(supervoxels.normal, finite), "a normal is not finite");
  require(std::ranges::all_of(supervoxels.of_point, known), "a point names an unknown supervoxel");
  for (const auto& [a, b] : supervoxels.adjacency)
    require(known(a) && known(b) && a != b, "a pair of neighbours is not two known supervoxels");
}

// PCL's labels are our ids + 1 (0 means none). Centroids are centred and in units of the scale,
// so that a result does not depend on where the object is or how large.
Clusters to_pcl(const Supervoxels& supervoxels, float scale) {
  const Eigen::Map<const Eigen::Matrix3Xf> centroid(supervoxels.centroid.data(), 3,
                                                    static_cast<Eigen::Index>(supervoxels.count()));
  const Eigen::Vector3f middle = centroid.cast<double>().rowwise().mean().cast<float>();
  Clusters clusters;
  for (std::size_t i = 0; i < supervoxels.count(); ++i) {
    pcl::Supervoxel<Point>::Ptr cluster(new pcl::Supervoxel<Point>);
    const Eigen::Vector3f at = (centroid.col(static_cast<Eigen::Index>(i)) - middle) / scale;
    require((at.array().abs() <= kWidest).all(),
            "they are too far apart for the distance of their seeds");
    cluster->centroid_.getVector3fMap() = at;
    cluster->normal_.getNormalVector3fMap() =
        Eigen::Map<const Eigen::Vector3f>(&supervoxels.normal[3 * i]);
    clusters.emplace(i + 1, std::move(cluster));
  }
  return clusters;
}

Neighbours to_pcl(const std::vector<std::array<std::int32_t, 2>>& adjacency) {
  Neighbours neighbours;
  for (const auto& [a, b] : adjacency)
    neighbours.emplace(static_cast<std::uint32_t>(a + 1), static_cast<std::uint32_t>(b + 1));
  return neighbours;
}

// Determinism: PCL seeds every plane model with the same number, visits edges in the order they
// are inserted, and cuts each segment on its own. Only its segment numbers follow the addresses of
// graph nodes; they are replaced by renumber().
// Lengths are multiples of the supervoxels' seed distance.
std::vector<std::int32_t> cut(const Supervoxels& supervoxels, const Params& params) {
  pcl::CPCSegmentation<Point> segmentation;
  segmentation.setConcavityToleranceThreshold(static_cast<float>(params.concavity_tolerance));
  segmentation.setSanityCheck(params.sanity_check);
  // The smoothness check is off; this is PCL's only way to set the inlier distance (the third
  // argument). The second is unused then.
  segmentation.setSmoothnessCheck(false, 1.0F, 1.0F);
  segmentation.setCutting(static_cast<std::uint32_t>(params.max_cuts),
                          static_cast<std::uint32_t>(params.min_cut_edges),
                          static_cast<float>(params.min_cut_score), true, true, false);
  segmentation.setRANSACIterations(static_cast<std::uint32_t>(params.ransac_iterations));
  segmentation.setInputSupervoxels(to_pcl(supervoxels, supervoxels.seed_resolution),
                                   to_pcl(supervoxels.adjacency));
  segmentation.segment();

  std::map<std::uint32_t, std::uint32_t> segment_of_label;
  segmentation.getSupervoxelToSegmentMap(segment_of_label);
  std::vector<std::int32_t> segment(supervoxels.count());
  for (std::size_t i = 0; i < segment.size(); ++i)
    segment[i] = static_cast<std::int32_t>(segment_of_label.at(i + 1));
  return segment;
}

// Ids 0, 1, ... in the order of first occurrence; returns how many there are.
std::int32_t renumber(std::span<std::int32_t> segment) {
  std::map<std::int32_t, std::int32_t> number;
  for (std::int32_t& id : segment)
    id = number.try_emplace(id, static_cast<std::int32_t>(number.size())).first->second;
  return static_cast<std::int32_t>(number.size());
}

}  // namespace

Fields describe(Params& params) {
  return {
      number_field("concavity_tolerance", params.concavity_tolerance, 0.0, 180.0, "deg",
                   "Concave edges of a smaller angle between normals count as convex."),
      boolean_field("sanity_check", params.sanity_check,
                    "Edges along a crease, where convexity is not defined, count as concave."),
      integer_field("max_cuts", params.max_cuts, 0, 1000, "", "Levels of recursive cutting."),
      integer_field("min_cut_edges", params.min_cut_edges, 3, 1000000, "",
                    "Segments with fewer edges between their supervoxels are not cut."),
      number_field("min_cut_score", params.min_cut_score, 0.0, 2.0, "",
                   "Mean weight of the edges at a plane from which it cuts."),
      integer_field("ransac_iterations", params.ransac_iterations, 1, 1000000, "",
                    "Planes that are tried per segment and level."),
      integer_field("min_segment", params.min_segment, 0, 1000000, "",
                    "Segments of fewer supervoxels are merged into a neighbour."),
      choice_field("merge", params.merge,
                   "Order and target of merging: least concave boundary first, or the original."),
  };
}

Segments compute(const Supervoxels& supervoxels, const Params& params) {
  silence_pcl();
  check(supervoxels);
  if (!(supervoxels.seed_resolution > 0.0F))
    throw InputError("the supervoxels' seed distance is not positive");

  Segments segments;
  segments.of_supervoxel = cut(supervoxels, params);
  renumber(segments.of_supervoxel);
  if (params.merge == Merge::concavity)
    merge_by_concavity(supervoxels, params.min_segment, segments.of_supervoxel);
  else
    merge_by_size(supervoxels, params.min_segment, segments.of_supervoxel);
  segments.count = renumber(segments.of_supervoxel);

  segments.of_point.reserve(supervoxels.of_point.size());
  for (const std::int32_t supervoxel : supervoxels.of_point)
    segments.of_point.push_back(segments.of_supervoxel[supervoxel]);
  for (const Boundary& boundary : boundaries_of(supervoxels, segments.of_supervoxel)) {
    segments.adjacency.push_back({boundary.a, boundary.b});
    segments.concavity.push_back(static_cast<float>(boundary.score()));
  }
  return segments;
}

}  // namespace cosegraph::cpc

template <>
cosegraph::Names<cosegraph::cpc::Merge> cosegraph::names<cosegraph::cpc::Merge>() {
  using cosegraph::cpc::Merge;
  static constexpr std::pair<Merge, std::string_view> table[] = {{Merge::concavity, "concavity"},
                                                                 {Merge::size, "size"}};
  return table;
}
