// Bags of words, eq. (3), and Fisher vectors, eq. (4)-(7), of feature packets: fixed-size random
// subsets of point clusters (Araslanov et al., section 3.3).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/fields.hpp"
#include "core/values.hpp"
#include "fisher/mixture.hpp"

namespace cosegraph::fisher {

enum class Method { fv, bow };
enum class Pool {
  cluster,  // a vector per cluster, averaged over the packet (the paper's wording)
  packet,   // one vector over all descriptors of the packet
};
enum class BowForm {
  posterior,  // mean posterior (6): (3) normalised over k
  literal,    // (3) as printed, in the log domain and scaled by the largest component
};

// What reference and query must share; travels in the model as a recipe.
struct Encoding {
  Method method = Method::fv;
  BowForm bow = BowForm::posterior;
  Pool pool = Pool::packet;
  double alpha = 0.5;       // power normalisation sign(z)|z|^alpha, after averaging; 1: none
  bool l2 = false;          // each channel's block scaled to unit length
  int cluster_points = 25;  // keypoints of a cluster: the nearest of the same part or segment
  int packet_clusters = 5;
};

Fields describe(Encoding& encoding);

// The BoW vector (K) or Fisher vector (2 K D: all G_mu, then all G_sigma) of `samples` (T x D)
// before power normalisation. Scaling of (4) and (5) as printed.
std::vector<float> encode(const GaussianMixture& mixture, std::span<const float> samples,
                          const Encoding& encoding);

// Length of one channel's block.
int block_size(const GaussianMixture& mixture, const Encoding& encoding);

// The clusters and packets of one part or segment in one channel. Packets are lists of clusters,
// clusters lists of rows of the channel (see DescriptorChannel).
struct Packets {
  std::vector<std::vector<std::int32_t>> cluster;  // rows, nearest to the centre first
  std::vector<std::vector<std::int32_t>> packet;   // indices into `cluster`
};

struct Draw {
  int clusters = 40;  // per part and view
  int packets = 20;   // per part and view
  std::uint64_t seed = 1;
};

// Draws clusters with uniformly sampled centres among the points of the same group, and packets
// of them. `xyz` are the cloud's points, `group` the part or segment of each, `which` the wanted
// one. Centres are points of the cloud and shared by all channels, so that the packets of several
// channels describe the same places. One Packets per channel; empty where the group has no
// keypoint in any one channel.
std::vector<Packets> draw_packets(std::span<const float> xyz, std::span<const std::int32_t> group,
                                  std::int32_t which, std::span<const DescriptorChannel> channels,
                                  const Encoding& encoding, const Draw& draw);

// Adds the clusters and packets of `more` behind those of `packets`.
void append(Packets& packets, const Packets& more);

// The packet vectors: packets x sum of block sizes, each block power-normalised and multiplied by
// its channel's block_scale. `projected[c]` are the rows of channel c after its projection.
std::vector<float> encode_packets(std::span<const Packets> packets,
                                  std::span<const std::vector<float>> projected,
                                  std::span<const AppearanceChannel> channels,
                                  const Encoding& encoding);

struct Params {
  int clusters = 20;  // per segment of the query
  int packets = 10;   // per segment of the query
  std::uint64_t seed = 1;
};

Fields describe(Params& params);

// Packet vectors of every segment of a query frame. A segment without keypoints in some channel
// borrows the keypoints nearest to its points, so that every segment has packets. Throws
// MismatchError, naming both sides, if cloud or descriptors were made with another recipe than the
// model's.
Encodings encode_segments(const Cloud& cloud, const Descriptors& descriptors,
                          const Segments& segments, const AppearanceModel& model,
                          const Params& params);

}  // namespace cosegraph::fisher

template <>
cosegraph::Names<cosegraph::fisher::Method> cosegraph::names<cosegraph::fisher::Method>();
template <>
cosegraph::Names<cosegraph::fisher::Pool> cosegraph::names<cosegraph::fisher::Pool>();
template <>
cosegraph::Names<cosegraph::fisher::BowForm> cosegraph::names<cosegraph::fisher::BowForm>();
