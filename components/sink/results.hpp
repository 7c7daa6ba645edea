// The figures of labelled frames, and their picture.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/values.hpp"
#include "sink/sink.hpp"

namespace cosegraph::sink {

struct Result {
  std::string name;
  std::int64_t points = 0;  // of the input
  std::int64_t labelled_points = 0;
  std::int32_t segments = 0;
  std::vector<std::string> label_names;
  std::vector<std::int64_t> points_per_label;
  double mean_confidence = 0.0;  // over labelled points
  double energy = 0.0;
  bool proven_optimal = false;
  double gap = 0.0;
  std::int32_t violations = 0;
  std::vector<std::string> notes;        // of the input cloud
  std::optional<Evaluation> evaluation;  // where the input carries true labels
};

Result result_of(const std::string& name, const Cloud& input, const Segments& segments,
                 const Labelling& labelling);

// results.json: {"frames": [...], "mean": {...}} with figures in 0 .. 1; the mean is over evaluated
// frames. It grows by a frame at a time without what stands before being written again, however
// long the stream.
class ResultsText {
 public:
  // Goes on with `earlier`, such a text, without its frames of the name `redone`. Of a text whose
  // writer was stopped in the middle of a frame that frame is missing. Throws InputError if it is
  // something else.
  explicit ResultsText(std::string_view earlier = "", std::string_view redone = "");

  // As it is before the first add.
  const std::string& begun() const { return begun_; }
  bool began_with(std::string_view frame) const { return earlier_.contains(frame); }

  // What the text is from byte `at` on; before that it stays as it is.
  struct Growth {
    std::size_t at = 0;
    std::string bytes;
  };
  Growth add(const Result& result);

 private:
  std::string grow(const nlohmann::ordered_json& frame);  // the bytes to append
  std::string tail() const;

  std::string begun_;
  std::set<std::string, std::less<>> earlier_;  // names
  std::size_t size_ = 0;                        // without the tail, which follows the frames
  std::size_t count_ = 0;
  int evaluated_ = 0;
  double accuracy_ = 0.0;  // sums over these
  double floor_ = 0.0;
  double oracle_ = 0.0;
};

struct PictureOf {
  std::string name;
  const Cloud* input = nullptr;
  const Segments* segments = nullptr;
  const Labelling* labelling = nullptr;
  const Cloud* reference = nullptr;  // labelled cloud, shown first; null: none
};

// PNG bytes: reference, query, segments, labels, and the true labels where they are known.
std::string picture_of(const PictureOf& frame);

}  // namespace cosegraph::sink
