// cosegraph as a library: learns two views of a labelled scene and labels a third, without DDS.
#include <cmath>
#include <iostream>
#include <pipeline/pipeline.hpp>

namespace {

// A ball with a stick on top, seen from above and turned by `angle`.
cosegraph::Cloud lollipop(double angle) {
  cosegraph::Cloud cloud;
  cloud.label_names = {"ball", "stick"};
  const auto add = [&](double x, double y, double z, int label) {
    const double turned_x = std::cos(angle) * x - std::sin(angle) * y;
    const double turned_y = std::sin(angle) * x + std::cos(angle) * y;
    for (const double value : {turned_x, turned_y, z})
      cloud.xyz.push_back(static_cast<float>(value));
    cloud.label.push_back(label);
  };
  for (double u = -1.0; u < 1.0; u += 0.015)
    for (double v = -1.0; v < 1.0; v += 0.015)
      if (u * u + v * v < 0.98) add(u, v, 5.0 - std::sqrt(1.0 - u * u - v * v), 0);
  for (double along = 1.0; along < 3.0; along += 0.015)
    for (double across = -0.15; across < 0.15; across += 0.015)
      add(along, across, 5.0 - std::sqrt(0.0226 - across * across), 1);
  cloud.width = static_cast<std::uint32_t>(cloud.size());
  return cloud;
}

}  // namespace

int main() {
  using namespace cosegraph;
  const pipeline::Config config = pipeline::config_from_name("fpfh+fv");
  const std::vector<Cloud> views{lollipop(0.0), lollipop(1.0)};
  const Model model = pipeline::train(views, config);
  const pipeline::Result result = pipeline::segment(lollipop(2.5), model, config);
  const Cloud& input = result.features.frame.input;
  std::size_t right = 0;
  for (std::size_t i = 0; i < input.size(); ++i)
    right += input.label[i] == result.labelling.point_label[input.dense_index[i]];
  const double accuracy = static_cast<double>(right) / static_cast<double>(input.size());
  std::cout << "accuracy " << accuracy << '\n';
  return accuracy > 0.9 ? 0 : 1;
}
