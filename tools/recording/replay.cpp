#include "tools/recording/replay.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "graph/control.hpp"
#include "graph/dds.hpp"
#include "graph/runtime.hpp"
#include "tools/recording/recording.hpp"
#include "tools/recording/stage_frames.hpp"

namespace cosegraph::recording {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kReaderPatience = 500ms;  // for more readers when the first are there
constexpr auto kLastPatience = 2s;       // with readers that have not got everything at the end

bool is_stopped(const ReplayOptions& options) {
  return options.stop != nullptr && options.stop->load();
}

// Waits until `due`, or until the replay is stopped.
void wait_until(Clock::time_point due, const ReplayOptions& options) {
  while (!is_stopped(options)) {
    const auto left = due - Clock::now();
    if (left <= 0ns) return;
    std::this_thread::sleep_for(std::min<Clock::duration>(left, 50ms));
  }
}

std::uint64_t wall_nanoseconds() {
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                        std::chrono::system_clock::now().time_since_epoch())
                                        .count());
}

idl::Bytes bytes_of(const Message& message) {
  return {message.data.begin(), message.data.end()};
}

// -- to everybody --------------------------------------------------------------------------------

class Replay {
 public:
  Replay(const McapReader& reader, const graph::GraphDescription& graph,
         const ReplayOptions& options)
      : reader_(reader), options_(options), participant_(graph, graph.graph + "/replay") {
    const std::map<std::uint16_t, Topic> all = topics_in(reader);
    std::vector<Topic> topics;
    for (const auto& [id, topic] : all) topics.push_back(topic);
    topics = choose(std::move(topics), options.topics);
    // What people ordered then is not ordered anew.
    std::erase_if(topics, [](const Topic& topic) {
      return topic.type == "Command" || topic.type == "Reply";
    });
    for (const auto& [id, topic] : all)
      if (std::ranges::find(topics, topic) != topics.end()) {
        topics_[id] = topic;
        writers_[id] = participant_.writer(topic.name, topic.type, qos_of(topic, graph));
      }
  }

  ReplayReport run() {
    if (options_.wait) await_readers();
    publish_older_models();
    do {
      round();
      if (is_stopped(options_)) return report_;
      ++report_.rounds;
    } while (options_.loop);
    const auto end = Clock::now() + kLastPatience;
    for (const auto& [id, writer] : writers_)
      writer->await_readers(
          std::max(0ms, std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now())));
    return report_;
  }

 private:
  // Until every topic of a stage has a reader, or some have and no more come.
  void await_readers() const {
    int known = 0;
    auto newest = Clock::now();
    while (!is_stopped(options_)) {
      int all = 0;
      bool every = true;
      for (const auto& [id, topic] : topics_) {
        const int readers = writers_.at(id)->matched();
        all += readers;
        every = every && (topic.is_control() || readers > 0);
      }
      if (all != known) newest = Clock::now();
      known = all;
      if (every || (all > 0 && Clock::now() - newest > kReaderPatience)) return;
      std::this_thread::sleep_for(20ms);
    }
  }

  std::set<std::uint16_t> channels(bool latched_only) const {
    std::set<std::uint16_t> ids;
    for (const auto& [id, topic] : topics_)
      if (topic.latched || !latched_only) ids.insert(id);
    return ids;
  }

  void publish_older_models() {
    auto messages = reader_.messages({.to = options_.from, .channels = channels(true)});
    while (const auto message = messages.next()) publish(*message);
  }

  void round() {
    epochs_.clear();
    round_epoch_ = wall_nanoseconds();
    std::optional<std::uint64_t> first;
    const auto start = Clock::now();
    auto messages =
        reader_.messages({.from = options_.from, .to = options_.to, .channels = channels(false)});
    while (const auto message = messages.next()) {
      if (!first) first = message->log_time;
      const double after = static_cast<double>(message->log_time - *first) / options_.speed;
      wait_until(start + std::chrono::nanoseconds(static_cast<std::int64_t>(after)), options_);
      if (is_stopped(options_)) return;
      publish(*message);
    }
    if (!first) throw InputError(reader_.file().string() + ": holds nothing of what was chosen");
  }

  void publish(const Message& message) {
    idl::Bytes bytes = bytes_of(message);
    if (const std::uint64_t epoch = idl::decode_header(bytes).epoch; options_.loop && epoch != 0) {
      // In the order of the old ones, and above those of the rounds before.
      const auto known = epochs_.try_emplace(epoch, round_epoch_ + epochs_.size()).first;
      idl::set_epoch(bytes, known->second);
    }
    writers_.at(message.channel)->write(bytes);
    ++report_.messages;
  }

  const McapReader& reader_;
  const ReplayOptions& options_;
  graph::Participant participant_;
  std::map<std::uint16_t, Topic> topics_;
  std::map<std::uint16_t, std::unique_ptr<graph::Writer>> writers_;
  std::map<std::uint64_t, std::uint64_t> epochs_;  // recorded: of this round
  std::uint64_t round_epoch_ = 0;
  ReplayReport report_;
};

// -- to one stage --------------------------------------------------------------------------------

class Into {
 public:
  Into(const McapReader& reader, const graph::GraphDescription& graph, const std::string& name,
       std::unique_ptr<graph::Stage> stage, const ReplayOptions& options)
      : graph_(graph),
        name_(name),
        options_(options),
        wiring_(wiring_of(graph, name, info_of(*stage))),
        frames_(reader, wiring_, StageFrames::Want::inputs, graph.window, options.from, options.to),
        stage_(std::move(stage)),
        participant_(graph, graph.graph + "/replay") {
    if (wiring_.frame_inputs.empty())
      throw ParameterError("stage '" + name + "' takes no frames that could be replayed");
    for (const auto& [id, topic] : topics_in(reader)) open_writer(topic);
    const Topic done{.type = "FrameDone"};
    reader_ = participant_.reader(graph::control_topic(graph, "frame_done"), done.type,
                                  qos_of(done, graph),
                                  [this](const graph::Sample& sample) { receive_done(*sample); });
  }

  IntoReport run() {
    while (const auto frame = is_stopped(options_) ? std::nullopt : frames_.next()) give(*frame);
    if (runner_ == nullptr) return report_;
    if (!is_stopped(options_)) end_epoch();
    const idl::StageStatus status = runner_->status();
    const std::scoped_lock lock(mutex_);
    report_.interrupted = is_stopped(options_);
    report_.status = status;
    return report_;
  }

 private:
  static graph::StageInfo info_of(graph::Stage& stage) {
    return {.inputs = stage.inputs(), .outputs = stage.outputs()};
  }

  void open_writer(const Topic& topic) {
    const auto is_input = [&](const std::map<std::string, std::string>& ports) {
      return std::ranges::any_of(ports,
                                 [&](const auto& entry) { return entry.second == topic.name; });
    };
    if (topic.type == "FrameFailure" || topic.type == "StreamEnd")
      control_[topic.type] = participant_.writer(topic.name, topic.type, qos_of(topic, graph_));
    else if (is_input(wiring_.frame_inputs) || is_input(wiring_.model_inputs))
      inputs_[topic.name] = participant_.writer(topic.name, topic.type, qos_of(topic, graph_));
    stage_of_[topic.name] = topic.stage;
  }

  void receive_done(const idl::Bytes& bytes) {
    try {
      const idl::FrameHeader header = idl::decode_header(bytes);
      if (header.stage != name_) return;
      const auto done = idl::decode<idl::FrameDone>(bytes);
      const std::scoped_lock lock(mutex_);
      if (header.epoch != epoch_) return;
      if (done.outcome == idl::Outcome::ended) {
        ended_ = true;
        end_failure_ = done.reason;
      } else if (done_.insert(header.sequence).second && done.outcome == idl::Outcome::failed &&
                 done.failed_stage == name_) {
        ++report_.failed;
      }
    } catch (const Error&) {
      return;  // a stranger's message
    }
    changed_.notify_all();
  }

  void give(const RecordedFrame& frame) {
    const bool is_whole = frame.failed_before.empty() && frame.lacking.empty();
    if (runner_ == nullptr && !is_whole) {
      ++report_.skipped;
      return;
    }
    if (runner_ == nullptr) start(frame.header);
    if (frame.header.epoch != epoch_) {
      end_epoch();
      begin_epoch(frame.header, 0);
    }
    // Frames of which there is no trace.
    for (; next_ < frame.header.sequence; ++next_) skip(with_sequence(frame.header, next_), "");
    next_ = frame.header.sequence + 1;
    if (is_whole)
      publish(frame);
    else
      skip(frame.header, frame.failed_before);
  }

  static idl::FrameHeader with_sequence(idl::FrameHeader header, std::uint64_t sequence) {
    header.sequence = sequence;
    return header;
  }

  // A recording that begins in the middle of a stream is taken by a stage as one that was started
  // again there.
  void start(const idl::FrameHeader& first) {
    graph::RunnerOptions options{.generation = first.sequence > 0 ? 1U : 0U, .leaves = {name_}};
    given_before_ = report_.skipped;
    begin_epoch(first, first.sequence);
    runner_ = std::make_unique<graph::StageRunner>(graph_, name_, std::move(stage_), options);
  }

  void begin_epoch(const idl::FrameHeader& header, std::uint64_t first) {
    const std::scoped_lock lock(mutex_);
    epoch_ = header.epoch;
    source_ = header.source;
    first_ = next_ = first;
    done_.clear();
    ended_ = false;
  }

  void publish(const RecordedFrame& frame) {
    await_room();
    for (const auto& [port, topic] : wiring_.model_inputs)
      if (auto& newest = models_[port]; newest != frame.inputs.at(port)) {
        newest = frame.inputs.at(port);
        inputs_.at(topic)->write(*newest);
      }
    for (const auto& [port, topic] : wiring_.frame_inputs)
      inputs_.at(topic)->write(*frame.inputs.at(port));
    ++report_.frames;
  }

  // A tombstone, so that the stage does not wait for the frame.
  void skip(idl::FrameHeader header, const std::string& failed_stage) {
    await_room();
    const std::string any = stage_of_.at(wiring_.frame_inputs.begin()->second);
    header.stage = failed_stage.empty() ? any : failed_stage;
    control_.at("FrameFailure")
        ->write(idl::encode(header, idl::FrameFailure{"it was not recorded in full"}));
    ++report_.skipped;
  }

  void await_room() {
    await([this] {
      const std::uint64_t given = report_.frames + report_.skipped - given_before_;
      return given < done_.size() + static_cast<std::uint64_t>(graph_.window);
    });
  }

  void end_epoch() {
    await([this] { return done_.size() >= next_ - first_; });
    const idl::FrameHeader header{.graph = graph_.graph,
                                  .stage = source_,
                                  .source = source_,
                                  .epoch = epoch_,
                                  .sequence = next_};
    control_.at("StreamEnd")->write(idl::encode(header, idl::StreamEnd{next_}));
    await([this] { return ended_; });
    const std::scoped_lock lock(mutex_);
    if (ended_ && !end_failure_.empty()) throw Error(name_ + ": " + end_failure_);
    given_before_ = report_.frames + report_.skipped;
  }

  // Waits for the stage, at most as long as the graph's deadline gives it for a frame.
  template <class Condition>
  void await(Condition condition) {
    const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                             std::chrono::duration<double>(graph_.deadline));
    std::unique_lock lock(mutex_);
    while (!condition()) {
      if (is_stopped(options_)) return;
      changed_.wait_for(lock, 50ms, condition);
      if (condition()) return;
      if (runner_->failed()) throw Error(name_ + ": " + runner_->status().activity);
      if (Clock::now() > deadline) throw Error(name_ + " does not finish its frames");
    }
  }

  const graph::GraphDescription graph_;
  const std::string name_;
  const ReplayOptions& options_;
  const StageWiring wiring_;
  StageFrames frames_;
  std::unique_ptr<graph::Stage> stage_;

  std::mutex mutex_;  // guards what follows, up to participant_
  std::condition_variable changed_;
  std::uint64_t epoch_ = 0;
  std::uint64_t first_ = 0;  // sequence number that the stage was given first in this epoch
  std::uint64_t next_ = 0;   // and the one it is given next
  std::string source_;
  std::set<std::uint64_t> done_;  // sequence numbers
  bool ended_ = false;
  std::string end_failure_;
  IntoReport report_;
  std::uint64_t given_before_ = 0;  // frames of earlier epochs

  graph::Participant participant_;
  std::map<std::string, std::unique_ptr<graph::Writer>> inputs_;   // by topic
  std::map<std::string, std::unique_ptr<graph::Writer>> control_;  // by type
  std::map<std::string, std::string> stage_of_;                    // topic: stage that gives it
  std::map<std::string, graph::Sample> models_;                    // by port: published last
  std::unique_ptr<graph::Reader> reader_;
  std::unique_ptr<graph::StageRunner> runner_;
};

}  // namespace

ReplayReport replay(const McapReader& reader, const graph::GraphDescription& graph,
                    const ReplayOptions& options) {
  return Replay(reader, graph, options).run();
}

IntoReport replay_into(const McapReader& reader, const graph::GraphDescription& graph,
                       const std::string& name, std::unique_ptr<graph::Stage> stage,
                       const ReplayOptions& options) {
  return Into(reader, graph, name, std::move(stage), options).run();
}

}  // namespace cosegraph::recording
