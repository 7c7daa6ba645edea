#include "graph/runtime.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <limits>
#include <mutex>
#include <set>
#include <thread>

#include "graph/control.hpp"
#include "graph/dds.hpp"
#include "graph/figures.hpp"
#include "graph/join.hpp"
#include "graph/journal.hpp"
#include "graph/ledger.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using idl::FrameHeader;
using idl::Outcome;
using idl::State;

constexpr std::size_t kModelsKept = 2;  // the newest of a latched input
constexpr auto kModelPatience = 10s;    // for a model id that is not known yet
constexpr auto kTick = 50ms;            // of the timer
constexpr auto kStatusPeriod = 250ms;
constexpr auto kResumePatience = 5s;  // for the source's word on which frames are over
constexpr auto kAbandonAfter = 2s;    // leaves' time to report an overdue frame
constexpr auto kHoldPatience = 15s;   // drained, and nobody has taken the place
constexpr std::uint32_t kDeathsOfAFrame = 2;
constexpr int kCommandDepth = 16;
constexpr auto kLastEpoch = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());

// How many processes read an output.
int consumers_of(const GraphDescription& graph, const std::string& stage, const std::string& port) {
  int count = 0;
  for (const auto& other : graph.stages)
    for (const auto& input : other.inputs)
      if (input.from_stage == stage && input.from_port == port)
        count += static_cast<int>(hosts_of(other).size());
  return count;
}

// The first time after `time` that all processes of a host take for a whole number of periods.
std::chrono::steady_clock::time_point next_multiple(std::chrono::milliseconds period,
                                                    std::chrono::steady_clock::time_point time) {
  return std::chrono::steady_clock::time_point(
      (std::chrono::floor<std::chrono::milliseconds>(time.time_since_epoch()) / period + 1) *
      period);
}

JoinOptions join_options(const GraphDescription& graph, const StageNode& node,
                         const RunnerOptions& options) {
  using Start = JoinOptions::Start;
  return {.start = options.standby          ? Start::standby
                   : options.generation > 0 ? Start::resume
                                            : Start::beginning,
          .window = graph.window,
          .replica = static_cast<int>(options.replica),
          .replicas = static_cast<int>(hosts_of(node).size())};
}

}  // namespace

void apply_params(const GraphDescription& graph, const StageNode& node, Stage& stage) {
  std::vector<Fault> faults;
  const Fields fields = stage.parameters();
  for (const auto& setting : node.params) {
    try {
      set_field(fields, setting.name, setting.value);
    } catch (const ParameterError& error) {
      faults.push_back({graph.file, setting.mark, node.name + ": " + error.what()});
    }
  }
  if (!faults.empty()) throw GraphError(std::move(faults));
}

class StageRunner::Impl final : public StageHost {
 public:
  Impl(const GraphDescription& graph, const std::string& name, std::unique_ptr<Stage> stage,
       const RunnerOptions& options)
      : graph_(graph),
        node_(*graph_.stage(name)),
        stage_(std::move(stage)),
        source_(dynamic_cast<SourceStage*>(stage_.get())),
        options_(options),
        is_leaf_(std::ranges::find(options.leaves, name) != options.leaves.end()),
        upstream_(upstream_of(graph_, name)),
        standby_(options.standby),
        join_(frame_inputs(), join_options(graph_, node_, options)),
        ledger_(options.leaves, graph_.window),
        participant_(graph_, graph_.graph + "/" + name, Identity::of_stage(name)) {
    for (const auto& input : node_.inputs) stage_->connect(input.port);
    stage_->attach(*this);
    status_.kind = node_.use;
    const std::string host = hosts_of(node_).at(options.replica);
    status_.host = host.empty() ? machine_name() : host;
    status_.pid = static_cast<std::uint32_t>(::getpid());
    status_.replica = options.replica;
    status_.candidate = options.standby;
    if (!standby_) open_journal();
    open_writers();
    stage_->start();
    status_.recipe = stage_->recipe();
    open_readers();
    worker_ = std::thread([this] { work(); });
    timer_ = std::thread([this] { tick(); });
  }

  ~Impl() override {
    request_stop();
    if (worker_.joinable()) worker_.join();
    if (timer_.joinable()) timer_.join();
    readers_.clear();  // no callback after this
  }

  void request_stop() {
    {
      const std::scoped_lock lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
  }

  idl::StageStatus status() const {
    const std::scoped_lock lock(mutex_);
    return current_status();
  }

  // -- StageHost ---------------------------------------------------------------------------------

  void publish_latched(const std::string& port, const idl::Bytes& bytes) override {
    {
      const std::scoped_lock lock(mutex_);
      if (standby_) {
        held_.emplace_back(port, bytes);
        return;
      }
    }
    write(port, bytes);
  }

  void report(std::string_view activity, double progress) override {
    const std::scoped_lock lock(mutex_);
    status_.activity = activity;
    status_.progress = progress;
  }

  bool stopping() const override {
    const std::scoped_lock lock(mutex_);
    return stop_;
  }

  bool resumed() const override { return options_.generation > 0; }

  FrameHeader header() const override {
    return {.graph = graph_.graph,
            .stage = node_.name,
            .generation = options_.generation,
            .stamp = wall_nanoseconds()};
  }

  int domain() const override { return graph_.dds.domain; }

 private:
  const PortInfo& input_info(const std::string& port) const {
    for (const auto& info : stage_->inputs())
      if (info.name == port) return info;
    throw Error("stage " + node_.name + " has no input " + port);
  }

  // Connected inputs that deliver one message per frame.
  std::vector<std::string> frame_inputs() const {
    std::vector<std::string> ports;
    for (const auto& input : node_.inputs)
      if (!input_info(input.port).latched) ports.push_back(input.port);
    return ports;
  }

  void open_writers() {
    const EndpointQos frames{.depth = frame_history(graph_)};
    for (const auto& port : stage_->outputs()) {
      const std::string topic = topic_name(graph_, node_.name, port.name);
      outputs_[port.name] = participant_.writer(
          topic, port.type,
          port.latched ? EndpointQos{.depth = static_cast<int>(kModelsKept)} : frames);
      traffic_["out/" + port.name] = {.name = port.name, .topic = topic, .output = true};
    }
    status_writer_ =
        participant_.writer(control_topic(graph_, "stage_status"), "StageStatus", {.depth = 1});
    failure_writer_ =
        participant_.writer(control_topic(graph_, "frame_failure"), "FrameFailure", frames);
    if (is_leaf_)
      done_writer_ = participant_.writer(control_topic(graph_, "frame_done"), "FrameDone", frames);
    if (source_ != nullptr)
      end_writer_ =
          participant_.writer(control_topic(graph_, "stream_end"), "StreamEnd", {.depth = 1});
  }

  void write(const std::string& port, const idl::Bytes& bytes) {
    outputs_.at(port)->write(bytes);
    const std::scoped_lock lock(mutex_);
    count_traffic("out/" + port, bytes.size());
  }

  void count_traffic(const std::string& key, std::size_t bytes) {
    idl::PortTraffic& traffic = traffic_.at(key);
    ++traffic.messages;
    traffic.bytes += bytes;
  }

  void open_readers() {
    const EndpointQos frames{.depth = frame_history(graph_)};
    for (const auto& input : node_.inputs) {
      const PortInfo& info = input_info(input.port);
      const std::string topic = topic_name(graph_, input.from_stage, input.from_port);
      const std::string key = "in/" + input.port;
      traffic_[key] = {.name = input.port, .topic = topic};
      if (info.latched)
        read(topic, info.type, {.depth = static_cast<int>(kModelsKept)},
             [this, key, port = input.port, from = input.from_stage, type = info.type](
                 const FrameHeader& header, Sample sample) {
               if (header.stage != from) return;
               idl::check(type, *sample);  // what cannot be used must not replace what can
               count_traffic(key, sample->size());
               keep_latched(latched_[port], header.model_id, std::move(sample));
             });
      else
        read(topic, info.type, frames,
             [this, key, port = input.port, from = input.from_stage](const FrameHeader& header,
                                                                     Sample sample) {
               if (header.stage != from) return;
               count_traffic(key, sample->size());
               join_.add(port, header, std::move(sample));
             });
    }
    input_readers_ = readers_.size();
    read(control_topic(graph_, "command"), "Command", {.depth = kCommandDepth},
         [this](const FrameHeader&, const Sample& sample) {
           const auto command = idl::decode<idl::Command>(*sample);
           if (command.stage == node_.name) obey(command);
         });
    read(control_topic(graph_, "stage_status"), "StageStatus", status_qos(),
         [this](const FrameHeader& header, const Sample& sample) { hear(header, *sample); });
    if (source_ != nullptr)
      open_source_readers(frames);
    else
      open_stream_readers(frames);
  }

  // What a stage says of itself it says over and over; only who goes on in the middle of a stream,
  // or has others' frames to do, must miss nothing, and know at once.
  EndpointQos status_qos() const {
    const bool all = options_.generation > 0 || !node_.replicas.empty();
    return all ? EndpointQos{.depth = kStatusDepth} : kOverheard;
  }

  using LatchedValues = std::deque<std::pair<std::uint64_t, Sample>>;  // by model id, newest last

  static void keep_latched(LatchedValues& values, std::uint64_t id, Sample sample) {
    std::erase_if(values, [&](const auto& value) { return value.first == id; });
    values.push_back({id, std::move(sample)});
    if (values.size() > kModelsKept) values.pop_front();
  }

  void open_stream_readers(const EndpointQos& frames) {
    read(control_topic(graph_, "frame_failure"), "FrameFailure", frames,
         [this](const FrameHeader& header, const Sample& sample) {
           if (header.stage == node_.name || !upstream_.contains(header.stage)) return;
           join_.fail(header, header.stage, idl::decode<idl::FrameFailure>(*sample).reason);
         });
    read(control_topic(graph_, "stream_end"), "StreamEnd", {.depth = 1},
         [this](const FrameHeader& header, const Sample& sample) {
           if (header.stage != header.source) return;
           join_.end(header, idl::decode<idl::StreamEnd>(*sample).count);
         });
  }

  void open_source_readers(const EndpointQos& frames) {
    read(control_topic(graph_, "frame_done"), "FrameDone", frames,
         [this](const FrameHeader& header, const Sample& sample) {
           if (header.epoch != epoch_) return;
           ledger_.done(header.stage, header, idl::decode<idl::FrameDone>(*sample));
           record_account();
         });
  }

  // Other stages' statuses: which frames are over, who is at work, which replicas are given up.
  void hear(const FrameHeader& header, const idl::Bytes& bytes) {
    const StageNode* sender = graph_.stage(header.stage);
    if (sender == nullptr) return;
    const bool from_source = header.stage == header.source;
    const bool from_own = header.stage == node_.name;
    const bool from_replica = from_own && !node_.replicas.empty();
    if (source_ == nullptr && !from_source && !from_own) return;
    const auto status = idl::decode<idl::StageStatus>(bytes);
    if (status.replica >= hosts_of(*sender).size()) return;
    if (from_own && header.generation > options_.generation && !status.candidate &&
        status.replica == options_.replica && status.pid != 0)
      replaced_ = true;
    if (source_ != nullptr)
      at_work_[{header.stage, status.replica}] = {header.sequence, status.state == State::working};
    else if (from_source && !status.candidate)
      join_.settle({header.epoch, status.settled});
    if (from_replica && status.replica != options_.replica && !status.candidate)
      join_.give_up(static_cast<int>(status.replica),
                    status.state == State::failed || status.state == State::stopped);
  }

  // Calls `take` under the lock with every well-formed message of a topic. Epochs are nanoseconds
  // since 1970: one that no clock shows before 2262 would be followed by none.
  void read(const std::string& topic, const std::string& type, const EndpointQos& qos,
            std::function<void(const FrameHeader&, Sample)> take) {
    readers_.push_back(
        participant_.reader(topic, type, qos, [this, take = std::move(take)](Sample sample) {
          try {
            const FrameHeader header = idl::decode_header(*sample);
            if (header.epoch > kLastEpoch) return;
            const std::scoped_lock lock(mutex_);
            take(header, std::move(sample));
          } catch (const std::exception&) {
            // A stranger's; one of a stage of ours is missed by the deadline.
          }
          changed_.notify_all();
        }));
  }

  // -- orders ------------------------------------------------------------------------------------

  void obey(const idl::Command& command) {
    if (options_.generation < command.generation) {
      if (command.verb == verb::kDrain) draining_ = true;
      if (command.verb == verb::kRelease) draining_ = false;
    }
    if (command.verb != verb::kActivate || command.generation != options_.generation || !standby_)
      return;
    handover_ = Handover{};
    for (const auto& word : command.words)
      if (const auto handover = Handover::from_word(word);
          handover && handover->replica == options_.replica)
        handover_ = *handover;
    standby_ = false;
  }

  // Whether its inputs are fed and its outputs heard; else what is missing. Readers that come
  // later are served all the same: this is so that taking over leaves no pause.
  std::string missing() const {
    for (std::size_t i = 0; i < input_readers_; ++i)
      if (readers_[i]->matched() == 0) return "nobody feeds input '" + node_.inputs[i].port + "'";
    {
      const std::scoped_lock lock(mutex_);
      for (const auto& input : node_.inputs)
        if (input_info(input.port).latched && latched_value(input.port, 0) == nullptr)
          return "no model on input '" + input.port + "'";
    }
    for (const auto& [port, writer] : outputs_)
      if (writer->matched() < consumers_of(graph_, node_.name, port))
        return "not all readers of output '" + port + "' are there";
    return "";
  }

  // Ready to take over: waits for the order to. False if stopped.
  bool stand_by() {
    for (std::string lacks = missing();; lacks = missing()) {
      set_state(lacks.empty() ? State::standby : State::starting, lacks);
      std::unique_lock lock(mutex_);
      const auto over = [this] { return stop_ || !standby_; };
      if (lacks.empty())
        changed_.wait(lock, over);
      else
        changed_.wait_for(lock, 20ms, over);
      if (over()) break;
    }
    std::vector<std::pair<std::string, idl::Bytes>> held;
    {
      const std::scoped_lock lock(mutex_);
      if (stop_) return false;
      if (source_ == nullptr) join_.activate(handover_.next);
      status_.candidate = false;
      held.swap(held_);
      open_journal();  // which was its predecessor's until now
    }
    for (const auto& [port, bytes] : held) write(port, bytes);
    return true;
  }

  // Holds until it is released or stopped; if whoever ordered that is gone and nobody has taken its
  // place, it goes on.
  void hold() {
    set_state(State::drained, "");
    {
      std::unique_lock lock(mutex_);
      const auto over = [this] { return stop_ || !draining_; };
      while (!changed_.wait_for(lock, kHoldPatience, over))
        if (!replaced_) draining_ = false;
      if (stop_) return;
    }
    set_state(State::waiting, "");
  }

  // -- journal -----------------------------------------------------------------------------------

  // What stands in it stays until there is something newer, also if this process dies at once.
  void open_journal() {
    if (options_.journal.empty()) return;
    journal_ = std::make_unique<Journal>(options_.journal);
    const bool follows_the_dead = options_.generation > 0 && !options_.standby;
    if (const auto left = journal_->load(); follows_the_dead && left) {
      predecessor_ = *left;
      if (left->working) predecessor_.deaths = left->deaths + 1;
      record_ = *left;
      record_.working = false;
    } else if (options_.standby) {
      record_.epoch = handover_.next.epoch;
      record_.taken = handover_.taken;
      record_.account = handover_.account;
    }
    record_.generation = options_.generation;
    journal_->store(record_);
  }

  bool is_fatal(const FrameHeader& header) const {
    return predecessor_.working && predecessor_.epoch == header.epoch &&
           predecessor_.sequence == header.sequence && predecessor_.deaths >= kDeathsOfAFrame;
  }

  void record_work(const FrameHeader& header, bool working) {
    if (journal_ == nullptr) return;
    const bool again = predecessor_.working && predecessor_.epoch == header.epoch &&
                       predecessor_.sequence == header.sequence;
    record_.working = working;
    record_.epoch = header.epoch;
    record_.sequence = header.sequence;
    record_.deaths = again ? predecessor_.deaths : 0;
    journal_->store(record_);
  }

  void record_account() {
    if (journal_ == nullptr) return;
    record_.account = ledger_.account();
    const auto open = ledger_.open();
    record_.open_count = static_cast<std::uint32_t>(std::min(open.size(), record_.open.size()));
    std::copy_n(open.begin(), record_.open_count, record_.open.begin());
    journal_->store(record_);
  }

  // -- worker ------------------------------------------------------------------------------------

  void work() {
    try {
      if (!standby_ || stand_by()) {
        if (source_ != nullptr)
          admit_frames();
        else if (!frame_inputs().empty())
          take_frames();
        else
          provide();
      }
    } catch (const std::exception& error) {
      set_state(State::failed, error.what());
    }
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_; });
  }

  // A stage that only has latched outputs, which start() has published.
  void provide() {
    set_state(State::waiting, "");
    for (;;) {
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return stop_ || draining_; });
        if (stop_) return;
      }
      hold();
    }
  }

  void take_frames() {
    set_state(State::waiting, "");
    for (;;) {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return stop_ || draining_ || join_.ready(); });
      if (stop_) return;
      if (draining_) {
        lock.unlock();
        hold();
        continue;
      }
      Join::Released next = *join_.take();
      lock.unlock();
      switch (next.kind) {
        case Join::Released::Kind::frame:
          process(own_header(next.header), std::move(next.inputs));
          break;
        case Join::Released::Kind::failed:
          publish_done(next.header, {Outcome::failed, next.failed_stage, next.reason});
          break;
        case Join::Released::Kind::ended:
          end_stream(next.header);
          break;
      }
    }
  }

  void end_stream(const FrameHeader& header) {
    idl::FrameDone done{.outcome = Outcome::ended};
    set_state(State::working, "finishing");
    try {
      stage_->end();
      set_state(State::finished, "");
    } catch (const std::exception& error) {
      done.failed_stage = node_.name;
      done.reason = error.what();
      set_state(State::failed, error.what());
    }
    publish_done(header, done);
  }

  FrameHeader own_header(FrameHeader header) const {
    header.stage = node_.name;
    header.generation = options_.generation;
    return header;
  }

  // Works on one frame and publishes its outputs, or its failure.
  void process(const FrameHeader& header, std::map<std::string, Sample> inputs) {
    begin_frame(header);
    const auto start = Clock::now();
    std::string reason;
    try {
      if (is_fatal(header))
        throw Error("its process has died " + std::to_string(predecessor_.deaths) +
                    " times over this frame");
      add_latched(header.model_id, inputs);
      Frame frame(header, std::move(inputs));
      stage_->process(frame);
      for (const auto& [port, bytes] : frame.outputs()) write(port, bytes);
    } catch (const std::exception& error) {
      reason = error.what();
      if (reason.empty()) reason = "unknown error";
    }
    if (!reason.empty()) failure_writer_->write(idl::encode(header, idl::FrameFailure{reason}));
    publish_done(header, reason.empty() ? idl::FrameDone{.outcome = stage_->leaf_outcome()}
                                        : idl::FrameDone{Outcome::failed, node_.name, reason});
    end_frame(header, std::chrono::duration<double, std::milli>(Clock::now() - start).count(),
              !reason.empty());
  }

  void publish_done(const FrameHeader& header, const idl::FrameDone& done) {
    if (is_leaf_) done_writer_->write(idl::encode(own_header(header), done));
  }

  // Adds to `inputs` the latched values that a frame with this model needs.
  void add_latched(std::uint64_t model_id, std::map<std::string, Sample>& inputs) {
    for (const auto& input : node_.inputs) {
      if (!input_info(input.port).latched) continue;
      std::unique_lock lock(mutex_);
      Sample found;
      changed_.wait_for(lock, kModelPatience, [&] {
        found = latched_value(input.port, model_id);
        return stop_ || found != nullptr;
      });
      if (found == nullptr)
        throw MismatchError("model " + std::to_string(model_id) + " has not arrived on input '" +
                            input.port + "'");
      inputs[input.port] = std::move(found);
    }
  }

  // The newest value of `port`, or with a model id the one that belongs to it.
  Sample latched_value(const std::string& port, std::uint64_t model_id) const {
    const auto values = latched_.find(port);
    if (values == latched_.end()) return nullptr;
    for (auto value = values->second.rbegin(); value != values->second.rend(); ++value)
      if (model_id == 0 || value->first == model_id) return value->second;
    return nullptr;
  }

  // -- source ------------------------------------------------------------------------------------

  void admit_frames() {
    set_state(State::waiting, "waiting for the model");
    const std::uint64_t first_model = await_model();
    FrameHeader header = this->header();
    header.source = node_.name;
    header.model_id = first_model;
    begin_epoch(header);
    source_->skip(taken_);
    set_state(State::waiting, "");
    auto due = Clock::now();
    std::optional<std::string> name;
    for (;;) {
      if (stopping()) return;
      if (must_drain()) {
        hold();
        due = Clock::now();
        continue;
      }
      if (!name && source_->live() && !is_next_due()) continue;
      if (!name) name = source_->next();
      if (!name) break;
      const Room room = await_room(due);
      if (room == Room::interrupted) continue;
      if (room == Room::dropped) {
        count_taken(false);
        name.reset();
        continue;
      }
      header.name = *name;
      header.stamp = wall_nanoseconds();
      header.model_id = newest_model(header.model_id);
      {
        const std::scoped_lock lock(mutex_);
        ledger_.admit(header, Clock::now());
        next_admission_ = header.sequence + 1;
      }
      count_taken(true);
      process(header, {});
      ++header.sequence;
      name.reset();
    }
    end_writer_->write(idl::encode(header, idl::StreamEnd{header.sequence}));
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_ || ledger_.ended(); });
    if (stop_) return;
    const std::string failure = ledger_.end_failure();
    lock.unlock();
    set_state(failure.empty() ? State::finished : State::failed, failure);
  }

  // A new epoch, later than any before, whatever the clock says. What a predecessor that died had
  // in flight has failed.
  void begin_epoch(FrameHeader& header) {
    std::vector<std::uint64_t> lost;
    std::uint64_t before = 0;
    {
      const std::scoped_lock lock(mutex_);
      if (options_.standby) {
        ledger_.restore(handover_.account);
        taken_ = handover_.taken;
        before = handover_.next.epoch;
      } else if (predecessor_.generation > 0 || predecessor_.taken > 0) {
        lost.assign(predecessor_.open.begin(), predecessor_.open.begin() + predecessor_.open_count);
        idl::Account account = predecessor_.account;
        account.failed += lost.size();
        ledger_.restore(account);
        taken_ = predecessor_.taken;
        before = predecessor_.epoch;
      }
      header.epoch = epoch_ = std::max(static_cast<std::uint64_t>(wall_nanoseconds()), before + 1);
      frame_ = header;
    }
    for (const std::uint64_t sequence : lost) {
      FrameHeader gone = header;
      gone.epoch = before;
      gone.sequence = sequence;
      failure_writer_->write(idl::encode(gone, idl::FrameFailure{"its source was started again"}));
    }
    const std::scoped_lock lock(mutex_);
    record_.epoch = epoch_;
    record_.taken = taken_;
    record_account();
  }

  // Of a live source: whether there is room for a frame and a frame; waits a little for both.
  bool is_next_due() {
    {
      std::unique_lock lock(mutex_);
      ledger_.drop(source_->missed());
      const auto halted = [this] { return stop_ || draining_; };
      const auto may_go = [&] { return halted() || ledger_.has_room(); };
      if (!changed_.wait_for(lock, kTick, may_go) || halted()) return false;
    }
    return source_->ready(kTick);
  }

  void count_taken(bool admitted) {
    const std::scoped_lock lock(mutex_);
    if (!admitted) ledger_.drop(1);
    record_.taken = ++taken_;
    record_account();
  }

  // Admission has stopped and all that was admitted is over.
  bool must_drain() {
    std::unique_lock lock(mutex_);
    if (!draining_) return false;
    changed_.wait(lock, [this] { return stop_ || !draining_ || ledger_.in_flight() == 0; });
    return draining_ && !stop_;
  }

  enum class Room { there, dropped, interrupted };

  // Waits until a frame may be admitted. With a rate, `due` is when the frame arrives and moves on
  // by one period; the frame is dropped if the next one arrives before there is room.
  Room await_room(Clock::time_point& due) {
    std::unique_lock lock(mutex_);
    const auto halted = [this] { return stop_ || draining_; };
    const auto may_go = [&] { return halted() || ledger_.has_room(); };
    if (source_->rate() > 0.0) {
      if (changed_.wait_until(lock, due, halted)) return Room::interrupted;
      due += std::chrono::duration_cast<Clock::duration>(
          std::chrono::duration<double>(1.0 / source_->rate()));
      if (source_->drop_when_full() && !changed_.wait_until(lock, due, may_go))
        return Room::dropped;
    }
    changed_.wait(lock, may_go);
    return halted() ? Room::interrupted : Room::there;
  }

  // The id of the newest model once every latched input has one; 0 without latched inputs.
  std::uint64_t await_model() {
    for (const auto& input : node_.inputs) {
      std::unique_lock lock(mutex_);
      const bool arrived =
          changed_.wait_for(lock, std::chrono::duration<double>(graph_.deadline),
                            [&] { return stop_ || latched_value(input.port, 0) != nullptr; });
      if (!arrived)
        throw Error("no model arrived on input '" + input.port + "' from " + input.from_stage);
    }
    return newest_model(0);
  }

  std::uint64_t newest_model(std::uint64_t otherwise) const {
    const std::scoped_lock lock(mutex_);
    for (const auto& [port, values] : latched_)
      if (!values.empty()) return values.back().first;
    return otherwise;
  }

  // Fails frames that nobody finished in time, and gives up on leaves that do not react to that.
  void check_deadlines() {
    const auto now = Clock::now();
    const auto deadline =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(graph_.deadline));
    std::unique_lock lock(mutex_);
    const std::vector<FrameHeader> overdue = ledger_.overdue(now - deadline);
    for (const auto& header : overdue) overdue_.emplace_back(now + kAbandonAfter, header);
    while (!overdue_.empty() && overdue_.front().first <= now) {
      ledger_.abandon(overdue_.front().second);
      record_account();
      overdue_.pop_front();
      changed_.notify_all();
    }
    std::vector<std::string> reasons;
    for (const auto& header : overdue) reasons.push_back("timeout at " + busy_with(header));
    lock.unlock();
    for (std::size_t i = 0; i < overdue.size(); ++i)
      failure_writer_->write(idl::encode(overdue[i], idl::FrameFailure{reasons[i]}));
  }

  std::string busy_with(const FrameHeader& header) const {
    std::string stages;
    for (const auto& [who, work] : at_work_)
      if (work.second && work.first == header.sequence)
        stages += (stages.empty() ? "" : ", ") + who.first;
    return stages.empty() ? "an unknown stage" : stages;
  }

  // -- status ------------------------------------------------------------------------------------

  void begin_frame(const FrameHeader& header) {
    const std::scoped_lock lock(mutex_);
    frame_ = header;
    status_.state = State::working;
    ++status_.frames_in;
    if (source_ == nullptr) record_work(header, true);
  }

  void end_frame(const FrameHeader& header, double milliseconds, bool failed) {
    const std::scoped_lock lock(mutex_);
    status_.state = State::waiting;
    ++(failed ? status_.frames_failed : status_.frames_out);
    latencies_.add(milliseconds);
    if (source_ == nullptr) record_work(header, false);
  }

  void set_state(State state, std::string_view activity) {
    {
      const std::scoped_lock lock(mutex_);
      status_.state = state;
      status_.activity = activity;
      status_.progress = -1.0;
    }
    publish_status();
    changed_.notify_all();
  }

  idl::StageStatus current_status() const {
    idl::StageStatus status = status_;
    status.repeated = join_.ignored();
    status.queue = join_.waiting();
    status.next = source_ != nullptr ? taken_ : join_.position().sequence;
    status.settled = ledger_.settled(next_admission_);
    status.latency_median = latencies_.quantile(0.5);
    status.latency_p99 = latencies_.quantile(0.99);
    status.latency_sum = latencies_.sum();
    status.cpu_seconds = process_cpu_seconds();
    status.memory = resident_bytes();
    status.account = ledger_.account();
    for (const auto& [key, traffic] : traffic_) status.ports.push_back(traffic);
    return status;
  }

  void publish_status() {
    std::unique_lock lock(mutex_);
    const idl::StageStatus status = current_status();
    FrameHeader header = this->header();
    header.source = source_ != nullptr ? node_.name : frame_.source;
    header.epoch = source_ != nullptr ? epoch_ : join_.position().epoch;
    header.sequence = frame_.sequence;
    header.name = frame_.name;
    header.model_id = frame_.model_id;
    published_settled_ = status.settled;
    lock.unlock();
    status_writer_->write(idl::encode(header, status));
  }

  void tick() {
    auto published = Clock::now();
    std::optional<Clock::time_point> waiting;  // since a stream is heard
    std::unique_lock lock(mutex_);
    while (!stop_) {
      // At the same time as the others of this host: who reads all statuses wakes up once for them.
      changed_.wait_until(lock, next_multiple(kTick, Clock::now()), [this] { return stop_; });
      const auto now = Clock::now();
      if (!waiting && join_.position().epoch != 0) waiting = now;
      if (waiting && now - *waiting > kResumePatience) join_.resume_anyway();
      // Who is started in mid-stream begins there: the frames since must still be kept for it.
      const bool news =
          source_ != nullptr && ledger_.settled(next_admission_) >=
                                    published_settled_ + static_cast<std::uint64_t>(graph_.window);
      lock.unlock();
      try {
        if (source_ != nullptr) check_deadlines();
        if (news || now >= next_multiple(kStatusPeriod, published)) {
          publish_status();
          published = now;
        }
      } catch (const Error&) {
        // The next tick tries again; what matters is published by the worker.
      }
      lock.lock();
    }
  }

  const GraphDescription graph_;
  const StageNode& node_;
  std::unique_ptr<Stage> stage_;
  SourceStage* source_;  // null unless the stage is one
  const RunnerOptions options_;
  const bool is_leaf_;
  const std::set<std::string> upstream_;

  mutable std::mutex mutex_;  // guards what follows, up to participant_
  std::condition_variable changed_;
  bool stop_ = false;
  bool standby_;
  bool draining_ = false;
  bool replaced_ = false;  // a process of a later generation is in its place
  Handover handover_;      // what a candidate was told when it took its place
  std::vector<std::pair<std::string, idl::Bytes>> held_;  // latched values of a candidate
  Join join_;
  Ledger ledger_;
  std::uint64_t epoch_ = 0;           // sources, as the four that follow
  std::uint64_t next_admission_ = 0;  // sequence
  std::uint64_t published_settled_ = 0;
  std::uint64_t taken_ = 0;  // frames taken from the input by all processes of this source
  std::map<std::pair<std::string, std::uint32_t>, std::pair<std::uint64_t, bool>>
      at_work_;  // stage and replica: sequence, working
  std::deque<std::pair<Clock::time_point, FrameHeader>> overdue_;
  std::map<std::string, LatchedValues> latched_;
  std::map<std::string, idl::PortTraffic> traffic_;  // "in/PORT", "out/PORT"
  idl::StageStatus status_;
  FrameHeader frame_;
  Latencies latencies_;
  std::unique_ptr<Journal> journal_;
  JournalRecord predecessor_;
  JournalRecord record_;

  Participant participant_;
  std::map<std::string, std::unique_ptr<Writer>> outputs_;
  std::unique_ptr<Writer> status_writer_;
  std::unique_ptr<Writer> failure_writer_;
  std::unique_ptr<Writer> done_writer_;
  std::unique_ptr<Writer> end_writer_;
  std::vector<std::unique_ptr<Reader>> readers_;  // the inputs' first, in their order
  std::size_t input_readers_ = 0;
  std::thread worker_;
  std::thread timer_;
};

StageRunner::StageRunner(const GraphDescription& graph, const std::string& name,
                         std::unique_ptr<Stage> stage, const RunnerOptions& options)
    : impl_(std::make_unique<Impl>(graph, name, std::move(stage), options)) {}

StageRunner::~StageRunner() = default;

void StageRunner::request_stop() {
  impl_->request_stop();
}

bool StageRunner::failed() const {
  return impl_->status().state == State::failed;
}

idl::StageStatus StageRunner::status() const {
  return impl_->status();
}

StageInfo info_of(const std::string& kind, const StageFactory& make) {
  const std::shared_ptr<Stage> stage = make();
  return {.kind = kind,
          .summary = stage->summary(),
          .inputs = stage->inputs(),
          .outputs = stage->outputs(),
          .parameters = stage->parameters(),
          .owner = stage};
}

Catalog catalog_of(const StageTable& table) {
  Catalog catalog;
  for (const auto& [kind, make] : table)
    catalog[kind] = [kind = kind, make = make] { return info_of(kind, make); };
  return catalog;
}

}  // namespace cosegraph::graph
