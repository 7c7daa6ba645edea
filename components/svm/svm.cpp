#include "svm/svm.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/error.hpp"
#include "svm/gram.hpp"

template <>
cosegraph::Names<cosegraph::svm::Kernel> cosegraph::names<cosegraph::svm::Kernel>() {
  using enum cosegraph::svm::Kernel;
  static constexpr std::pair<svm::Kernel, std::string_view> table[] = {
      {automatic, "automatic"}, {linear, "linear"}, {rbf, "rbf"}};
  return table;
}

namespace cosegraph::svm {
namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Rows = Eigen::Map<const Matrix>;

constexpr double kTolerance = 1e-4;  // of the optimality conditions, in units of the margin
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t kMostProducts = 1 << 28;  // of vectors and labels or support vectors

Rows as_rows(std::span<const float> values, std::int32_t columns) {
  return {values.data(), static_cast<Eigen::Index>(values.size()) / columns, columns};
}

// Inner products -> exp(-gamma |a - b|^2), given the squared lengths of rows and columns.
void to_rbf(Matrix& products, const Eigen::VectorXf& rows, const Eigen::VectorXf& columns,
            double gamma) {
  products = ((2.0F * products).colwise() - rows).rowwise() - columns.transpose();
  products = (products.cwiseMin(0.0F) * static_cast<float>(gamma)).array().exp();
}

double variance(std::span<const float> values) {
  double sum = 0.0;
  for (const float v : values) sum += v;
  const double mean = sum / static_cast<double>(values.size());
  double squares = 0.0;
  for (const float v : values) squares += (v - mean) * (v - mean);
  return squares / static_cast<double>(values.size());
}

struct Machine {
  std::vector<double> coefficient;  // y_i alpha_i
  double bias = 0.0;
};

// The dual of the two-class machine, by pairs of variables: the most violating one, and the one
// that with it promises the largest step by second-order information (Fan, Chen, Lin, JMLR 2005).
class DualSolver {
 public:
  // `sign` is +-1, `cost` the upper bound of each variable.
  DualSolver(const Matrix& kernel, std::vector<double> sign, std::vector<double> cost)
      : kernel_(kernel),
        count_(sign.size()),
        sign_(std::move(sign)),
        cost_(std::move(cost)),
        alpha_(count_, 0.0),
        slack_(sign_) {}

  Machine solve() {
    const std::size_t limit = std::max<std::size_t>(100000, 100 * count_);
    for (std::size_t step = 0; step < limit; ++step) {
      const std::size_t up = most_violating();
      const std::size_t down = partner_of(up);
      if (up == count_ || slack_[up] - lowest_ < kTolerance) break;
      move(up, down);
    }
    Machine machine;
    for (std::size_t i = 0; i < count_; ++i) machine.coefficient.push_back(sign_[i] * alpha_[i]);
    machine.bias = 0.5 * (highest_ + lowest_);
    return machine;
  }

 private:
  // Whether y_i alpha_i may still rise, or fall.
  bool can_rise(std::size_t i) const {
    return sign_[i] > 0.0 ? alpha_[i] < cost_[i] : alpha_[i] > 0.0;
  }
  bool can_fall(std::size_t i) const {
    return sign_[i] > 0.0 ? alpha_[i] > 0.0 : alpha_[i] < cost_[i];
  }

  std::size_t most_violating() {
    std::size_t best = count_;
    highest_ = -kInfinity;
    for (std::size_t i = 0; i < count_; ++i)
      if (can_rise(i) && slack_[i] > highest_) {
        highest_ = slack_[i];
        best = i;
      }
    return best;
  }

  double curvature(std::size_t i, std::size_t j) const {
    return std::max(1e-12, double{kernel_(i, i)} + kernel_(j, j) - 2.0 * kernel_(i, j));
  }

  std::size_t partner_of(std::size_t up) {
    std::size_t best = count_;
    double largest_gain = -kInfinity;
    lowest_ = kInfinity;
    for (std::size_t j = 0; j < count_; ++j) {
      if (!can_fall(j)) continue;
      lowest_ = std::min(lowest_, slack_[j]);
      const double difference = highest_ - slack_[j];
      if (difference <= 0.0) continue;
      const double gain = difference * difference / curvature(up, j);
      if (gain > largest_gain) {
        largest_gain = gain;
        best = j;
      }
    }
    return best;
  }

  // y_up alpha_up rises and y_down alpha_down falls by the same step, so that sum y alpha stays 0.
  void move(std::size_t up, std::size_t down) {
    const double room_up = sign_[up] > 0.0 ? cost_[up] - alpha_[up] : alpha_[up];
    const double room_down = sign_[down] > 0.0 ? alpha_[down] : cost_[down] - alpha_[down];
    const double wanted = (slack_[up] - slack_[down]) / curvature(up, down);
    const double step = std::min({wanted, room_up, room_down});
    add(up, step, room_up);
    add(down, -step, room_down);
    const float* a = kernel_.row(static_cast<Eigen::Index>(up)).data();
    const float* b = kernel_.row(static_cast<Eigen::Index>(down)).data();
    for (std::size_t i = 0; i < count_; ++i) slack_[i] -= step * (double{a[i]} - b[i]);
  }

  // Sets the variable exactly to its bound where the step uses up its room.
  void add(std::size_t i, double step, double room) {
    const double moved = alpha_[i] + sign_[i] * step;
    alpha_[i] = std::abs(step) < room ? moved : (sign_[i] * step > 0.0 ? cost_[i] : 0.0);
  }

  const Matrix& kernel_;
  std::size_t count_;
  std::vector<double> sign_;
  std::vector<double> cost_;
  std::vector<double> alpha_;
  std::vector<double> slack_;  // y_i - sum_j y_j alpha_j K_ij: equals the bias at free variables
  double highest_ = 0.0;       // of the slacks that may rise
  double lowest_ = 0.0;        // of the slacks that may fall
};

std::size_t check_training(std::span<const float> vectors, int dimension,
                           std::span<const std::int32_t> label, int label_count) {
  if (dimension < 1 || label_count < 1) throw InputError("no dimension or no label to learn");
  const std::size_t count = label.size();
  if (vectors.size() != count * dimension)
    throw InputError(std::to_string(vectors.size()) + " numbers are not " + std::to_string(count) +
                     " vectors of " + std::to_string(dimension));
  for (std::size_t i = 0; i < vectors.size(); ++i)
    if (!std::isfinite(vectors[i]))
      throw InputError("vector " + std::to_string(i / dimension) + " is not finite");
  std::vector<bool> seen(label_count, false);
  for (const std::int32_t l : label) {
    if (l < 0 || l >= label_count) throw InputError("label " + std::to_string(l) + " is unknown");
    seen[l] = true;
  }
  for (int l = 0; l < label_count; ++l)
    if (!seen[l]) throw InputError("label " + std::to_string(l) + " has no vector");
  return count;
}

// `label` against all others.
Machine train_one(const Matrix& kernel, std::span<const std::int32_t> labels, std::int32_t label,
                  const TrainParams& params) {
  const std::size_t count = labels.size();
  const auto positive = static_cast<double>(std::ranges::count(labels, label));
  const double negative = static_cast<double>(count) - positive;
  std::vector<double> sign;
  std::vector<double> cost;
  for (const std::int32_t l : labels) {
    sign.push_back(l == label ? 1.0 : -1.0);
    const double share = 2.0 * (l == label ? positive : negative) / static_cast<double>(count);
    cost.push_back(params.balance ? params.cost / share : params.cost);
  }
  return DualSolver(kernel, std::move(sign), std::move(cost)).solve();
}

// Support vectors of any of the machines.
void keep_support(const Rows& vectors, const std::vector<Machine>& machines,
                  Classifier& classifier) {
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < static_cast<std::size_t>(vectors.rows()); ++i)
    if (std::ranges::any_of(machines, [i](const Machine& m) { return m.coefficient[i] != 0.0; }))
      kept.push_back(i);
  for (const std::size_t i : kept) {
    const auto row = vectors.row(static_cast<Eigen::Index>(i));
    classifier.support.insert(classifier.support.end(), row.data(), row.data() + row.size());
  }
  for (const Machine& machine : machines)
    for (const std::size_t i : kept)
      classifier.coefficient.push_back(static_cast<float>(machine.coefficient[i]));
}

void keep_weights(const Rows& vectors, const std::vector<Machine>& machines,
                  Classifier& classifier) {
  Matrix coefficient(machines.size(), vectors.rows());
  for (std::size_t m = 0; m < machines.size(); ++m)
    coefficient.row(static_cast<Eigen::Index>(m)) =
        Eigen::Map<const Eigen::RowVectorXd>(machines[m].coefficient.data(), vectors.rows())
            .cast<float>();
  const Matrix weight = coefficient * vectors;
  classifier.weight.assign(weight.data(), weight.data() + weight.size());
}

// Adds softmax(sharpness x margin) to `sum`.
void add_probability(std::span<const float> margin, double sharpness, std::span<double> sum) {
  const double largest = *std::ranges::max_element(margin);
  std::vector<double> e;
  double total = 0.0;
  for (const float m : margin) {
    e.push_back(std::exp(sharpness * (m - largest)));
    total += e.back();
  }
  for (std::size_t l = 0; l < e.size(); ++l) sum[l] += e[l] / total;
}

}  // namespace

Fields describe(TrainParams& params) {
  return {
      choice_field("kernel", params.kernel, "Automatic: linear for fv, rbf for bow."),
      number_field("cost", params.cost, 1e-6, 1e6, "", "Penalty of a violated margin."),
      number_field("gamma", params.gamma, 0.0, 1e6, "",
                   "Of the rbf kernel; 0: 1 / (dimension x variance of the vectors)."),
      boolean_field("balance", params.balance,
                    "Weigh both sides of a machine alike, however many packets they have."),
      number_field("sharpness", params.sharpness, 0.01, 100.0, "",
                   "Probability is the softmax of sharpness x margin."),
  };
}

Fields describe(Params&) {
  return {};
}

Classifier train(std::span<const float> vectors, int dimension, std::span<const std::int32_t> label,
                 int label_count, const TrainParams& params) {
  check_training(vectors, dimension, label, label_count);
  if (params.kernel == Kernel::automatic)
    throw ParameterError("kernel: 'automatic' must be resolved before training");
  const Rows rows = as_rows(vectors, dimension);
  Classifier result;
  result.kernel = to_name(params.kernel);
  result.dimension = dimension;
  result.label_count = label_count;
  result.sharpness = params.sharpness;

  Matrix kernel = as_rows(gram_matrix(vectors, dimension), static_cast<std::int32_t>(label.size()));
  if (params.kernel == Kernel::rbf) {
    const double spread = variance(vectors);
    result.gamma =
        params.gamma > 0.0 ? params.gamma : 1.0 / (dimension * (spread > 0.0 ? spread : 1.0));
    const Eigen::VectorXf squares = kernel.diagonal();
    to_rbf(kernel, squares, squares, result.gamma);
  }
  std::vector<Machine> machines;
  for (std::int32_t l = 0; l < label_count; ++l) {
    machines.push_back(label_count > 1 ? train_one(kernel, label, l, params)
                                       : Machine{std::vector<double>(label.size(), 0.0), 1.0});
    result.bias.push_back(static_cast<float>(machines.back().bias));
  }
  if (params.kernel == Kernel::linear)
    keep_weights(rows, machines, result);
  else
    keep_support(rows, machines, result);
  return result;
}

std::vector<float> margins(const Classifier& classifier, std::span<const float> vectors) {
  if (classifier.dimension < 1 || vectors.size() % classifier.dimension != 0)
    throw MismatchError("the classifier takes vectors of " + std::to_string(classifier.dimension) +
                        " numbers");
  const Rows rows = as_rows(vectors, classifier.dimension);
  const auto support_count =
      static_cast<std::int64_t>(classifier.support.size()) / classifier.dimension;
  const std::int64_t wide = std::max<std::int64_t>(classifier.label_count, support_count);
  if (wide > 0 && rows.rows() > kMostProducts / wide)
    throw InputError(std::to_string(rows.rows()) + " vectors are too many for a classifier of " +
                     std::to_string(classifier.label_count) + " labels and " +
                     std::to_string(support_count) + " support vectors");
  const Eigen::Map<const Eigen::RowVectorXf> bias(classifier.bias.data(), classifier.label_count);
  std::vector<float> result(rows.rows() * classifier.label_count);
  Eigen::Map<Matrix> out(result.data(), rows.rows(), classifier.label_count);
  if (classifier.kernel == to_name(Kernel::linear)) {
    out.noalias() = rows * as_rows(classifier.weight, classifier.dimension).transpose();
  } else {
    const Rows support = as_rows(classifier.support, classifier.dimension);
    Matrix kernel = rows * support.transpose();
    to_rbf(kernel, rows.rowwise().squaredNorm(), support.rowwise().squaredNorm(), classifier.gamma);
    const Rows coefficient(classifier.coefficient.data(), classifier.label_count, support.rows());
    out.noalias() = kernel * coefficient.transpose();
  }
  out.rowwise() += bias;
  return result;
}

Scores score(const Encodings& encodings, const AppearanceModel& model) {
  const Classifier& classifier = model.classifier;
  if (encodings.dimension != classifier.dimension)
    throw MismatchError("packet vectors have " + std::to_string(encodings.dimension) +
                        " numbers, the model's classifier takes " +
                        std::to_string(classifier.dimension));
  if (encodings.value.size() != encodings.segment.size() * encodings.dimension)
    throw InputError("packet vectors and their segments do not fit");
  const std::size_t labels = model.label_names.size();
  if (static_cast<std::size_t>(classifier.label_count) != labels ||
      model.label_share.size() != labels)
    throw InputError("the model's classifier and labels differ in number");
  const std::vector<float> margin = margins(classifier, encodings.value);
  std::vector<double> sum(static_cast<std::size_t>(encodings.segment_count) * labels, 0.0);
  std::vector<int> packets(encodings.segment_count, 0);
  for (std::size_t p = 0; p < encodings.segment.size(); ++p) {
    const std::int32_t segment = encodings.segment[p];
    if (segment < 0 || segment >= encodings.segment_count)
      throw InputError("packet " + std::to_string(p) + " belongs to segment " +
                       std::to_string(segment) + " of " + std::to_string(encodings.segment_count));
    add_probability(std::span(margin).subspan(p * labels, labels), classifier.sharpness,
                    std::span(sum).subspan(segment * labels, labels));
    ++packets[segment];
  }
  Scores result;
  result.label_names = model.label_names;
  const auto& share = model.label_share;
  result.majority = static_cast<std::int32_t>(std::ranges::max_element(share) - share.begin());
  result.segment_count = encodings.segment_count;
  for (std::int32_t s = 0; s < encodings.segment_count; ++s)
    for (std::size_t l = 0; l < labels; ++l)
      result.probability.push_back(packets[s] == 0
                                       ? 1.0F / static_cast<float>(labels)
                                       : static_cast<float>(sum[s * labels + l] / packets[s]));
  return result;
}

}  // namespace cosegraph::svm
