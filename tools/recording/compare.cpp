#include "tools/recording/compare.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>

#include "idl/members.hpp"

template <>
cosegraph::Names<cosegraph::recording::FrameComparison::Verdict>
cosegraph::names<cosegraph::recording::FrameComparison::Verdict>() {
  using enum recording::FrameComparison::Verdict;
  static constexpr std::pair<recording::FrameComparison::Verdict, std::string_view> kTable[] = {
      {identical, "identical"}, {differs, "differs"}, {not_comparable, "not comparable"}};
  return kTable;
}

namespace cosegraph::recording {
namespace {

using Verdict = FrameComparison::Verdict;

bool same(double a, double b) {
  return std::memcmp(&a, &b, sizeof a) == 0;  // a NaN is the same as itself
}
template <class Value>
bool same(const Value& a, const Value& b) {
  return a == b;
}

double distance(double a, double b) {
  const double difference = std::abs(a - b);
  return std::isnan(difference) ? std::numeric_limits<double>::infinity() : difference;
}

// How two members of one name differ; `changed` 0 and equal sizes if they do not.
Difference difference(const idl::Member& before, const idl::Member& now) {
  Difference result{.member = now.name, .size_before = before.size(), .size = now.size()};
  std::visit(
      [&](const auto& values) {
        using Values = std::decay_t<decltype(values)>;
        const auto* old = std::get_if<Values>(&before.values);
        if (old == nullptr) {
          result.changed = values.size();
          return;
        }
        for (std::size_t i = 0; i < std::min(values.size(), old->size()); ++i) {
          if (same((*old)[i], values[i])) continue;
          ++result.changed;
          if constexpr (std::is_same_v<Values, std::vector<double>>)
            result.largest = std::max(result.largest, distance((*old)[i], values[i]));
        }
        result.is_real = std::is_same_v<Values, std::vector<double>>;
      },
      now.values);
  return result;
}

bool is_within(const Difference& difference, double tolerance) {
  return difference.is_real && difference.size == difference.size_before &&
         difference.largest <= tolerance;
}

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

// Compares what the stage gave with what it gave then.
void compare_outputs(const RecordedFrame& before, const graph::Frame& now,
                     const StageWiring& wiring, double tolerance, FrameComparison& result) {
  for (const auto& [port, topic] : wiring.frame_outputs) {
    const auto recorded = before.outputs.find(port);
    const auto made = now.outputs().find(port);
    if (recorded == before.outputs.end() || made == now.outputs().end()) {
      if (recorded != before.outputs.end()) {
        result.verdict = Verdict::differs;
        result.note = "nothing is given on '" + port + "' any more";
      }
      continue;
    }
    if (*recorded->second == made->second) continue;
    auto found = differences(wiring.types.at(port), *recorded->second, made->second);
    std::erase_if(found, [&](const Difference& one) { return is_within(one, tolerance); });
    if (found.empty()) continue;
    result.verdict = Verdict::differs;
    result.ports[port] = std::move(found);
  }
}

}  // namespace

std::vector<Difference> differences(std::string_view type, std::span<const std::uint8_t> before,
                                    std::span<const std::uint8_t> now) {
  const std::vector<idl::Member> old_members = idl::members_of(type, before);
  std::map<std::string, const idl::Member*> old;
  for (const auto& member : old_members) old[member.name] = &member;
  std::vector<Difference> result;
  for (const auto& member : idl::members_of(type, now)) {
    const auto found = old.find(member.name);
    if (found == old.end()) {
      result.push_back({.member = member.name, .size = member.size()});
      continue;
    }
    const Difference one = difference(*found->second, member);
    if (one.changed > 0 || one.size != one.size_before) result.push_back(one);
    old.erase(found);
  }
  for (const auto& member : old_members)
    if (old.contains(member.name))
      result.push_back({.member = member.name, .size_before = member.size()});
  return result;
}

FrameComparison compare(const RecordedFrame& before, const StageWiring& wiring, graph::Stage& stage,
                        double tolerance) {
  FrameComparison result{.name = before.header.name,
                         .epoch = before.header.epoch,
                         .sequence = before.header.sequence,
                         .verdict = Verdict::not_comparable};
  if (!before.failed_before.empty()) {
    result.note = "failed at " + before.failed_before;
    return result;
  }
  if (!before.lacking.empty()) {
    result.note = "not recorded: " + listed(before.lacking);
    return result;
  }
  if (before.outputs.size() < wiring.frame_outputs.size() && !before.failure) {
    result.note = "not recorded: what the stage gave";
    return result;
  }
  result.verdict = Verdict::identical;
  graph::Frame frame(before.header, before.inputs);
  const auto start = std::chrono::steady_clock::now();
  std::optional<std::string> failure;
  try {
    stage.process(frame);
  } catch (const std::exception& error) {
    failure = error.what();
  }
  result.milliseconds =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  if (failure != before.failure) {
    result.verdict = Verdict::differs;
    result.note = (before.failure ? "failed then (" + *before.failure + ")" : "did not fail then") +
                  ", " + (failure ? "fails now (" + *failure + ")" : "does not fail now");
  } else if (!failure) {
    compare_outputs(before, frame, wiring, tolerance, result);
  }
  return result;
}

}  // namespace cosegraph::recording
