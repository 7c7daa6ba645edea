// A stage of today against its recorded outputs: the recorded inputs are given to it once more,
// without DDS, and what it makes of them is compared.
#pragma once

#include <string>
#include <vector>

#include "tools/recording/stage_frames.hpp"

namespace cosegraph::recording {

// Where a member of a message is not what it was.
struct Difference {
  std::string member;
  std::size_t size_before = 0;
  std::size_t size = 0;
  std::size_t changed = 0;  // values that are not the same, where both have one
  bool is_real = false;     // floating point numbers
  double largest = 0.0;     // of the absolute differences; infinite where one is not a number
};

// Members that differ between two messages of a type, headers included.
std::vector<Difference> differences(std::string_view type, std::span<const std::uint8_t> before,
                                    std::span<const std::uint8_t> now);

struct FrameComparison {
  enum class Verdict { identical, differs, not_comparable };

  std::string name;
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;
  Verdict verdict = Verdict::identical;
  std::map<std::string, std::vector<Difference>> ports;  // that differ
  std::string note;                                      // why it is not comparable, or what failed
  double milliseconds = 0.0;                             // in process()
};

// `tolerance`: real numbers may differ by so much. A frame that fails for the reason it failed for
// when it was recorded is identical.
FrameComparison compare(const RecordedFrame& frame, const StageWiring& wiring, graph::Stage& stage,
                        double tolerance);

}  // namespace cosegraph::recording

template <>
cosegraph::Names<cosegraph::recording::FrameComparison::Verdict>
cosegraph::names<cosegraph::recording::FrameComparison::Verdict>();
