// One-vs-rest support vector machines over packet vectors: linear for Fisher vectors, RBF for
// bags of words (Araslanov et al., section 3.3). Scores of a segment's packets are averaged.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/fields.hpp"
#include "core/values.hpp"

namespace cosegraph::svm {

enum class Kernel { automatic, linear, rbf };  // automatic: linear for fv, rbf for bow

struct TrainParams {
  Kernel kernel = Kernel::automatic;
  double cost = 1.0;
  double gamma = 0.0;      // rbf; 0: 1 / (dimension x variance of the vectors)
  bool balance = true;     // cost of a class inversely proportional to its packets
  double sharpness = 3.0;  // probability = softmax(sharpness x margin)
};

Fields describe(TrainParams& params);

// `vectors` is N x dimension, `label` N indices below label_count. kernel must not be `automatic`.
// Throws InputError if a label below label_count has no vector, or a value is not finite. With one
// label the classifier always answers it.
Classifier train(std::span<const float> vectors, int dimension, std::span<const std::int32_t> label,
                 int label_count, const TrainParams& params);

// Margins of N vectors: N x label_count.
std::vector<float> margins(const Classifier& classifier, std::span<const float> vectors);

struct Params {};  // scoring has none: all belongs to the model
Fields describe(Params& params);

// p(l | T_i): softmax per packet, averaged over the packets of a segment; uniform for a segment
// without packets. Throws MismatchError if the dimensions differ.
Scores score(const Encodings& encodings, const AppearanceModel& model);

}  // namespace cosegraph::svm

template <>
cosegraph::Names<cosegraph::svm::Kernel> cosegraph::names<cosegraph::svm::Kernel>();
