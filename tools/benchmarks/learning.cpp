#include <linear.h>

extern "C" {
#include <vl/fisher.h>
#include <vl/generic.h>
#include <vl/gmm.h>
}

#include <cmath>
#include <cstdio>
#include <memory>

#include "core/random.hpp"
#include "fisher/fisher.hpp"
#include "svm/svm.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {
namespace {

using Values = std::vector<float>;

constexpr fisher::MixtureParams kMixture{.components = 32, .iterations = 15};

// Samples around 100 centres: a mixture of fewer components fits them with overlap.
Values clustered(int count, int dimension) {
  Random random(3);
  Values centres(static_cast<std::size_t>(100) * dimension);
  for (float& c : centres) c = static_cast<float>(2.0 * random.normal());
  Values result;
  for (int i = 0; i < count; ++i) {
    const float* centre = &centres[random.below(100) * dimension];
    for (int d = 0; d < dimension; ++d)
      result.push_back(centre[d] + static_cast<float>(random.normal()));
  }
  return result;
}

void vlfeat_mixture(const Values& samples, int dimension) {
  const std::unique_ptr<VlGMM, decltype(&vl_gmm_delete)> gmm(
      vl_gmm_new(VL_TYPE_FLOAT, dimension, kMixture.components), vl_gmm_delete);
  vl_gmm_set_initialization(gmm.get(), VlGMMKMeans);
  vl_gmm_set_max_num_iterations(gmm.get(), kMixture.iterations);
  vl_gmm_cluster(gmm.get(), samples.data(), samples.size() / dimension);
}

void vlfeat_fisher(const GaussianMixture& mixture, const Values& covariance,
                   std::span<const float> samples, Values& result) {
  vl_fisher_encode(result.data(), VL_TYPE_FLOAT, mixture.mean.data(), mixture.dimension,
                   mixture.components, covariance.data(), mixture.weight.data(), samples.data(),
                   samples.size() / mixture.dimension, 0);
}

// A whole query: 2400 points in 15 segments along the x axis, with 10 packets each of 5 clusters
// of 25 points.
struct Query {
  Cloud cloud;
  Segments segments{.count = 15};
  Descriptors descriptors;
  AppearanceModel model;

  explicit Query(fisher::Encoding encoding) {
    constexpr int kPoints = 2400;
    Random random(5);
    descriptors.channels = {{.name = "x", .dimension = 33, .value = clustered(kPoints, 33)}};
    for (int i = 0; i < kPoints; ++i) {
      const double x = random.uniform();
      for (const double v : {x, random.uniform(), random.uniform()})
        cloud.xyz.push_back(static_cast<float>(v));
      cloud.dense_index.push_back(i);
      segments.of_point.push_back(static_cast<std::int32_t>(segments.count * x));
      descriptors.channels[0].keypoint.push_back(i);
    }
    model.encoding_recipe = recipe(fisher::describe(encoding));
    model.channels = {
        {.name = "x",
         .dimension = 33,
         .mixture = fisher::fit_mixture(descriptors.channels[0].value, 33, kMixture)}};
  }

  void encode() const { fisher::encode_segments(cloud, descriptors, segments, model, {}); }
};

// Unit vectors of four classes around weak centres, as packets of Fisher vectors are.
struct Packets {
  static constexpr int kLabels = 4;
  int dimension;
  Values vectors;
  std::vector<std::int32_t> label;

  Packets(int count, int dimension) : dimension(dimension) {
    Random random(3);
    Values centres(static_cast<std::size_t>(kLabels) * dimension);
    for (float& c : centres) c = static_cast<float>(0.1 * random.normal());
    for (int i = 0; i < count; ++i) {
      label.push_back(i % kLabels);
      const float* centre = &centres[static_cast<std::size_t>(label.back()) * dimension];
      double sum = 0.0;
      for (int d = 0; d < dimension; ++d) {
        vectors.push_back(centre[d] + static_cast<float>(random.normal()));
        sum += double{vectors.back()} * vectors.back();
      }
      for (auto v = vectors.end() - dimension; v != vectors.end(); ++v)
        *v /= static_cast<float>(std::sqrt(sum));
    }
  }
};

// With the copy into liblinear's sparse rows, which a caller has to make.
void liblinear_classifier(const Packets& packets) {
  const auto count = static_cast<int>(packets.label.size());
  const int dimension = packets.dimension;
  std::vector<feature_node> nodes;
  nodes.reserve(static_cast<std::size_t>(count) * (dimension + 2));
  std::vector<feature_node*> rows;
  std::vector<double> label(packets.label.begin(), packets.label.end());
  const float* value = packets.vectors.data();
  for (int i = 0; i < count; ++i) {
    rows.push_back(nodes.data() + nodes.size());
    for (int d = 0; d < dimension; ++d) nodes.push_back({d + 1, *value++});
    nodes.push_back({dimension + 1, 1.0});
    nodes.push_back({-1, 0.0});
  }
  problem data{count, dimension + 1, label.data(), rows.data(), 1.0};
  parameter settings{};
  settings.solver_type = L2R_L1LOSS_SVC_DUAL;
  settings.C = 1.0;
  settings.eps = 0.1;  // its default
  set_print_string_function([](const char*) {});
  ::model* trained = ::train(&data, &settings);
  free_and_destroy_model(&trained);
}

template <class Ours, class Peer>
void compare(const char* name, const char* peer_name, int repeats, Ours&& ours, Peer&& peer) {
  std::vector<double> our_times;
  std::vector<double> peer_times;
  std::vector<double> ratios;
  for (int i = 0; i < repeats; ++i) {
    our_times.push_back(measure(ours).cpu);
    peer_times.push_back(measure(peer).cpu);
    ratios.push_back(our_times.back() / peer_times.back());
  }
  std::printf("  %-28s ours %8.2f ms   %-9s %8.2f ms   ratio %.3f\n", name, median(our_times),
              peer_name, median(peer_times), median(ratios));
}

void compare_mixtures(int repeats) {
  for (const int dimension : {33, 64}) {
    const Values samples = clustered(20000, dimension);
    const std::string name = "mixture 20000 x " + std::to_string(dimension);
    compare(
        name.c_str(), "VLFeat", repeats, [&] { fisher::fit_mixture(samples, dimension, kMixture); },
        [&] { vlfeat_mixture(samples, dimension); });
  }
}

void compare_fisher_vectors(int repeats) {
  constexpr int kPackets = 200;
  const Values samples = clustered(4000, 33);
  const GaussianMixture mixture = fisher::fit_mixture(samples, 33, kMixture);
  const auto packet = std::span(samples).first(75 * 33);
  Values covariance;
  for (const float s : mixture.sigma) covariance.push_back(s * s);
  Values result(2 * mixture.mean.size());
  compare(
      "200 Fisher vectors of 75", "VLFeat", repeats,
      [&] {
        for (int i = 0; i < kPackets; ++i) fisher::encode(mixture, packet, {});
      },
      [&] {
        for (int i = 0; i < kPackets; ++i) vlfeat_fisher(mixture, covariance, packet, result);
      });
}

void compare_classifiers(int repeats) {
  for (const auto& [count, dimension] : {std::pair{640, 2112}, {1280, 10432}}) {
    const Packets packets(count, dimension);
    const std::string name =
        "linear SVM " + std::to_string(count) + " x " + std::to_string(dimension);
    compare(
        name.c_str(), "liblinear", repeats,
        [&] {
          svm::train(packets.vectors, packets.dimension, packets.label, Packets::kLabels,
                     {.kernel = svm::Kernel::linear});
        },
        [&] { liblinear_classifier(packets); });
  }
}

void time_query(int repeats) {
  for (const auto method : {fisher::Method::fv, fisher::Method::bow}) {
    const Query query({.method = method});
    std::vector<double> times;
    for (int i = 0; i < repeats; ++i) times.push_back(measure([&] { query.encode(); }).cpu);
    std::printf("  encode a query, %-12s ours %8.2f ms\n", std::string(to_name(method)).c_str(),
                median(times));
  }
}

}  // namespace

int bench_learning(int repeats) {
  vl_set_num_threads(1);
  std::printf("learning: CPU ms on one thread, medians of %d\n", repeats);
  compare_mixtures(repeats);
  compare_fisher_vectors(repeats);
  compare_classifiers(repeats);
  time_query(repeats);
  return 0;
}

}  // namespace cosegraph::bench
