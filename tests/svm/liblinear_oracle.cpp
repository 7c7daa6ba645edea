#include <linear.h>

#include "svm/oracles.hpp"

namespace cosegraph::test {

std::vector<double> liblinear_margins(const Problem& problem, std::int32_t label,
                                      const OracleParams& params) {
  std::vector<std::vector<feature_node>> rows(problem.size());
  std::vector<feature_node*> pointers;
  std::vector<double> sign;
  for (std::size_t i = 0; i < problem.size(); ++i) {
    for (int d = 0; d < problem.dimension; ++d)
      rows[i].push_back({d + 1, problem.vectors[i * problem.dimension + d]});
    rows[i].push_back({-1, 0.0});
    pointers.push_back(rows[i].data());
    sign.push_back(problem.label[i] == label ? 1.0 : -1.0);
  }
  ::problem data{static_cast<int>(problem.size()), problem.dimension, sign.data(), pointers.data(),
                 -1.0};
  int weight_label[] = {1, -1};
  double weight[] = {params.positive_cost, params.negative_cost};
  parameter settings{};
  settings.solver_type = L2R_L1LOSS_SVC_DUAL;
  settings.C = 1.0;
  settings.eps = 1e-6;
  settings.nr_weight = 2;
  settings.weight_label = weight_label;
  settings.weight = weight;
  set_print_string_function([](const char*) {});
  model* trained = train(&data, &settings);
  const double orientation = trained->label[0];
  std::vector<double> result;
  for (feature_node* row : pointers) {
    double value = 0.0;
    predict_values(trained, row, &value);
    result.push_back(orientation * value);
  }
  free_and_destroy_model(&trained);
  return result;
}

}  // namespace cosegraph::test
