#include "descriptors/descriptors.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "pipeline/pipeline.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {
namespace {

using descriptors::Kernel;

// Per keypoint the distance of two descriptors, in lengths of the second.
struct Deviation {
  double mean = 0.0;
  double worst = 0.0;
};

Deviation deviation(const std::vector<float>& ours, const std::vector<float>& theirs, int width) {
  Deviation result;
  for (std::size_t row = 0; row < theirs.size(); row += width) {
    double difference = 0.0;
    double length = 0.0;
    for (std::size_t i = row; i < row + width; ++i) {
      difference += std::pow(static_cast<double>(ours.at(i)) - theirs[i], 2);
      length += std::pow(static_cast<double>(theirs[i]), 2);
    }
    const double relative = std::sqrt(difference / length);
    result.mean += relative * width / static_cast<double>(theirs.size());
    result.worst = std::max(result.worst, relative);
  }
  return result;
}

void bench_channel(const std::vector<Cloud>& clouds, const char* channel, int repeats) {
  std::vector<double> ours;
  std::vector<double> theirs;
  std::vector<double> ratios;
  Deviation mean;
  std::size_t keypoints = 0;
  for (const Cloud& cloud : clouds) {
    Descriptors own;
    Descriptors pcl;
    for (int i = 0; i < repeats; ++i) {
      const auto run = [&](Descriptors& result, Kernel kernel) {
        return measure([&] {
                 result = descriptors::compute(
                     cloud, {.channels = {channel}, .threads = 1, .kernel = kernel});
               })
            .cpu;
      };
      ours.push_back(run(own, Kernel::own));
      theirs.push_back(run(pcl, Kernel::pcl));
      ratios.push_back(theirs.back() / ours.back());
    }
    const auto& block = own.channels[0];
    const Deviation of_cloud = deviation(block.value, pcl.channels[0].value, block.dimension);
    mean.mean += of_cloud.mean / static_cast<double>(clouds.size());
    mean.worst = std::max(mean.worst, of_cloud.worst);
    keypoints += block.keypoint.size();
  }
  std::printf(
      "  %-16s %5zu keypoints   own %7.2f ms   PCL %7.2f ms   PCL/own %5.1f   "
      "deviation: mean %.1e, worst %.1e\n",
      channel, keypoints / clouds.size(), median(ours), median(theirs), median(ratios), mean.mean,
      mean.worst);
}

}  // namespace

int bench_descriptors(int repeats) {
  const Subject subject = load_subject();
  const pipeline::Config config = pipeline::config_from_name("fpfh+fv");
  std::vector<Cloud> clouds;
  std::size_t points = 0;
  for (const Cloud& query : subject.queries) {
    clouds.push_back(pipeline::extract(query, config).frame.cloud);
    points += clouds.back().size();
  }
  std::printf("descriptors: %s, %zu views of %zu points, one thread; CPU ms, medians of %d\n",
              subject.name.c_str(), clouds.size(), points / clouds.size(), repeats);
  for (const char* channel : {"fpfh:0.08", "fpfh:0.13", "shot:0.13", "shot:0.24"})
    bench_channel(clouds, channel, repeats);
  return 0;
}

}  // namespace cosegraph::bench
