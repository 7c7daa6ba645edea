#include <libsvm/svm.h>

#include "svm/oracles.hpp"

namespace cosegraph::test {

std::vector<double> libsvm_margins(const Problem& problem, std::int32_t label,
                                   const OracleParams& params) {
  std::vector<std::vector<svm_node>> rows(problem.size());
  std::vector<svm_node*> pointers;
  std::vector<double> sign;
  for (std::size_t i = 0; i < problem.size(); ++i) {
    for (int d = 0; d < problem.dimension; ++d)
      rows[i].push_back({d + 1, problem.vectors[i * problem.dimension + d]});
    rows[i].push_back({-1, 0.0});
    pointers.push_back(rows[i].data());
    sign.push_back(problem.label[i] == label ? 1.0 : -1.0);
  }
  svm_problem data{static_cast<int>(problem.size()), sign.data(), pointers.data()};
  int weight_label[] = {1, -1};
  double weight[] = {params.positive_cost, params.negative_cost};
  svm_parameter settings{};
  settings.svm_type = C_SVC;
  settings.kernel_type = params.gamma > 0.0 ? RBF : LINEAR;
  settings.gamma = params.gamma;
  settings.C = 1.0;
  settings.eps = 1e-5;
  settings.cache_size = 10;
  settings.nr_weight = 2;
  settings.weight_label = weight_label;
  settings.weight = weight;
  svm_set_print_string_function([](const char*) {});
  svm_model* model = svm_train(&data, &settings);
  const double orientation = model->label[0];  // libsvm's first label is the positive one
  std::vector<double> result;
  for (svm_node* row : pointers) {
    double value = 0.0;
    svm_predict_values(model, row, &value);
    result.push_back(orientation * value);
  }
  svm_free_and_destroy_model(&model);
  return result;
}

}  // namespace cosegraph::test
