#include "tools/recording/completeness.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

namespace cosegraph::recording {
namespace {

using nlohmann::json;

json to_json(const Range& range) {
  return {{"epoch", range.epoch}, {"first", range.first}, {"last", range.last}};
}

Range range_of(const json& value) {
  return {.epoch = value.at("epoch"), .first = value.at("first"), .last = value.at("last")};
}

}  // namespace

bool Completeness::has_all() const {
  return std::ranges::all_of(topics, [](const auto& topic) { return topic.second.has_all(); });
}

Metadata to_metadata(const Completeness& completeness) {
  json topics = json::object();
  for (const auto& [name, count] : completeness.topics) {
    json missing = json::array();
    for (const auto& range : count.missing) missing.push_back(to_json(range));
    topics[name] = {{"messages", count.messages},
                    {"bytes", count.bytes},
                    {"lost", count.lost},
                    {"missing", std::move(missing)},
                    {"missing_models", count.missing_models}};
  }
  json stretches = json::array();
  for (const auto& stretch : completeness.stretches)
    stretches.push_back({{"frames", to_json(stretch.frames)},
                         {"from_start", stretch.from_start},
                         {"to_end", stretch.to_end},
                         {"failed", stretch.failed}});
  return {.name = std::string(kCompletenessName),
          .values = {{"complete", completeness.has_all() ? "true" : "false"},
                     {"ended", completeness.ended},
                     {"topics", topics.dump()},
                     {"stretches", stretches.dump()}}};
}

Completeness completeness_of(const Metadata& metadata) {
  Completeness result;
  try {
    result.ended = metadata.values.at("ended");
    const json topics = json::parse(metadata.values.at("topics"));
    for (const auto& [name, topic] : topics.items()) {
      TopicCount& count = result.topics[name];
      count = {
          .messages = topic.at("messages"), .bytes = topic.at("bytes"), .lost = topic.at("lost")};
      count.missing_models = topic.at("missing_models").get<std::vector<std::uint64_t>>();
      for (const auto& range : topic.at("missing")) count.missing.push_back(range_of(range));
    }
    const json stretches = json::parse(metadata.values.at("stretches"));
    for (const auto& one : stretches)
      result.stretches.push_back({.frames = range_of(one.at("frames")),
                                  .from_start = one.at("from_start"),
                                  .to_end = one.at("to_end"),
                                  .failed = one.at("failed")});
  } catch (const std::exception& error) {
    throw InputError("the completeness record cannot be read: " + std::string(error.what()));
  }
  return result;
}

void Runs::add(std::uint64_t number) {
  auto after = runs_.upper_bound(number);
  const auto before = after == runs_.begin() ? runs_.end() : std::prev(after);
  if (before != runs_.end() && number <= before->second) return;
  const bool joins_after = after != runs_.end() && after->first == number + 1;
  const bool joins_before = before != runs_.end() && before->second + 1 == number;
  const std::uint64_t last = joins_after ? after->second : number;
  if (joins_after) runs_.erase(after);
  if (joins_before)
    before->second = last;
  else
    runs_[number] = last;
}

bool Runs::contains(std::uint64_t number) const {
  const auto after = runs_.upper_bound(number);
  return after != runs_.begin() && number <= std::prev(after)->second;
}

namespace {

// The stretches of first .. last that `runs` lacks.
std::vector<Range> gaps(const Runs& runs, const Range& range) {
  std::vector<Range> result;
  std::uint64_t next = range.first;
  for (const auto& [first, last] : runs.runs()) {
    if (first > range.last) break;
    if (first > next) result.push_back({range.epoch, next, first - 1});
    next = std::max(next, last + 1);
  }
  if (next <= range.last) result.push_back({range.epoch, next, range.last});
  return result;
}

// How many of first .. last are in `runs`.
std::uint64_t count_in(const Runs& runs, const Range& range) {
  const auto missing = gaps(runs, range);
  return std::accumulate(missing.begin(), missing.end(), range.count(),
                         [](std::uint64_t count, const Range& gap) { return count - gap.count(); });
}

}  // namespace

Tally::Tally(std::vector<Topic> topics, int history)
    : topics_(std::move(topics)),
      history_(static_cast<std::uint64_t>(history)),
      counts_(topics_.size()) {}

void Tally::add(std::size_t index, std::span<const std::uint8_t> bytes) {
  const Topic& topic = topics_[index];
  ++counts_[index].messages;
  counts_[index].bytes += bytes.size();
  const idl::FrameHeader header = idl::decode_header(bytes);
  if (topic.has_frames()) {
    epochs_[header.epoch].seen[index].add(header.sequence);
    if (header.model_id != 0) named_models_.insert(header.model_id);
  } else if (topic.latched) {
    models_[index].insert(header.model_id);
  } else if (topic.type == idl::type_name<idl::FrameFailure>()) {
    epochs_[header.epoch].failed[header.stage].add(header.sequence);
  } else if (topic.type == idl::type_name<idl::StreamEnd>()) {
    epochs_[header.epoch].length = header.sequence;
  }
}

// Of a topic of models, if somebody needs it.
std::vector<std::uint64_t> Tally::missing_models(std::size_t topic) const {
  std::vector<std::uint64_t> result;
  if (!topics_[topic].latched || !topics_[topic].taken) return result;
  const auto came = models_.find(topic);
  for (const std::uint64_t id : named_models_)
    if (came == models_.end() || !came->second.contains(id)) result.push_back(id);
  return result;
}

// The frames of a topic that came, or failed before they could.
Runs Tally::present(const Epoch& epoch, std::size_t topic) const {
  const auto seen = epoch.seen.find(topic);
  Runs runs = seen == epoch.seen.end() ? Runs{} : seen->second;
  for (const auto& stage : topics_[topic].upstream)
    if (const auto failed = epoch.failed.find(stage); failed != epoch.failed.end())
      for (const auto& [first, last] : failed->second.runs())
        for (std::uint64_t number = first; number <= last; ++number) runs.add(number);
  return runs;
}

// The frames that every topic ought to have.
std::optional<Stretch> Tally::stretch(std::uint64_t id, const Epoch& epoch,
                                      const std::map<std::size_t, Runs>& present) const {
  Stretch result{.frames = {.epoch = id}, .to_end = epoch.length.has_value()};
  if (epoch.length && *epoch.length == 0) return std::nullopt;
  std::uint64_t last = epoch.length ? *epoch.length - 1 : ~std::uint64_t{0};
  bool any = false;
  for (const auto& [topic, runs] : present) {
    if (runs.empty() && !epoch.length) return std::nullopt;
    if (runs.empty()) continue;  // lacks all that the others have
    any = true;
    result.frames.first = std::max(result.frames.first, runs.first());
    if (!epoch.length) last = std::min(last, runs.last());
  }
  if (!any || last < result.frames.first) return std::nullopt;
  result.frames.last = last;
  result.from_start = result.frames.first == 0;
  if (!result.from_start) {
    const Range joining{id, result.frames.first,
                        std::min(last, result.frames.first + history_ - 1)};
    for (const auto& [topic, runs] : present) {
      if (runs.empty()) continue;
      for (const auto& gap : gaps(runs, joining))
        result.frames.first = std::max(result.frames.first, gap.last + 1);
    }
    if (last < result.frames.first) return std::nullopt;
  }
  Runs failed;
  for (const auto& [stage, runs] : epoch.failed)
    for (const auto& [first, end] : runs.runs())
      for (std::uint64_t number = first; number <= end; ++number) failed.add(number);
  result.failed = count_in(failed, result.frames);
  return result;
}

Completeness Tally::completeness() const {
  std::vector<TopicCount> counts = counts_;
  Completeness result;
  for (const auto& [id, epoch] : epochs_) {
    std::map<std::size_t, Runs> all;
    for (std::size_t i = 0; i < topics_.size(); ++i)
      if (topics_[i].has_frames()) all[i] = present(epoch, i);
    const auto whole = stretch(id, epoch, all);
    if (!whole) continue;
    result.stretches.push_back(*whole);
    for (const auto& [topic, runs] : all)
      for (const auto& gap : gaps(runs, whole->frames)) counts[topic].missing.push_back(gap);
  }
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    counts[i].missing_models = missing_models(i);
    result.topics[topics_[i].name] = counts[i];
  }
  return result;
}

bool Tally::has_whole_stream() const {
  if (epochs_.empty()) return false;
  const auto& [id, epoch] = *epochs_.rbegin();
  if (!epoch.length) return false;
  if (*epoch.length == 0) return true;
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (!missing_models(i).empty()) return false;
    if (!topics_[i].has_frames()) continue;
    const Runs runs = present(epoch, i);
    if (runs.empty() || !gaps(runs, {id, runs.first(), *epoch.length - 1}).empty()) return false;
  }
  return true;
}

}  // namespace cosegraph::recording
