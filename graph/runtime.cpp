#include "graph/runtime.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <fstream>
#include <mutex>
#include <set>
#include <thread>

#include "graph/dds.hpp"
#include "graph/join.hpp"
#include "graph/ledger.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using idl::FrameHeader;
using idl::Outcome;
using idl::State;

constexpr std::size_t kModelsKept = 2;  // the newest of a latched input
constexpr auto kModelPatience = 10s;    // for a model id that is not known yet
constexpr auto kStatusPeriod = 250ms;
constexpr auto kAbandonAfter = 2s;           // leaves' time to report an overdue frame
constexpr std::size_t kLatencyWindow = 512;  // newest frames in the quantiles

std::int64_t wall_nanoseconds() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string host_name() {
  char name[256] = {};
  return ::gethostname(name, sizeof name - 1) == 0 ? name : "unknown";
}

double process_cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return t.tv_sec + 1e-6 * t.tv_usec; };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

std::uint64_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::uint64_t total = 0;
  std::uint64_t resident = 0;
  statm >> total >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

// Everything that `stage` depends on, itself included.
std::set<std::string> upstream_of(const GraphDescription& graph, const std::string& stage) {
  std::set<std::string> result;
  std::vector<std::string> todo{stage};
  while (!todo.empty()) {
    const std::string name = todo.back();
    todo.pop_back();
    if (!result.insert(name).second) continue;
    if (const StageNode* node = graph.stage(name))
      for (const auto& input : node->inputs) todo.push_back(input.from_stage);
  }
  return result;
}

class Latencies {
 public:
  void add(double milliseconds) {
    sum_ += milliseconds;
    newest_.push_back(milliseconds);
    if (newest_.size() > kLatencyWindow) newest_.pop_front();
  }
  double sum() const { return sum_; }
  double quantile(double q) const {
    if (newest_.empty()) return 0.0;
    std::vector<double> sorted(newest_.begin(), newest_.end());
    const auto at = static_cast<std::ptrdiff_t>(q * static_cast<double>(sorted.size() - 1) + 0.5);
    std::ranges::nth_element(sorted, sorted.begin() + at);
    return sorted[static_cast<std::size_t>(at)];
  }

 private:
  std::deque<double> newest_;
  double sum_ = 0.0;
};

}  // namespace

std::string control_topic(const GraphDescription& graph, std::string_view what) {
  return graph.graph + "/" + std::string(what);
}

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
        generation_(options.generation),
        is_leaf_(std::ranges::find(options.leaves, name) != options.leaves.end()),
        upstream_(upstream_of(graph_, name)),
        join_(frame_inputs(), options.generation > 0),
        ledger_(options.leaves, graph_.window),
        participant_(graph_, graph_.graph + "/" + name) {
    for (const auto& input : node_.inputs) stage_->connect(input.port);
    stage_->attach(*this);
    status_.kind = node_.use;
    status_.host = host_name();
    status_.pid = static_cast<std::uint32_t>(::getpid());
    open_writers();
    stage_->start();
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

  // -- StageHost
  // --------------------------------------------------------------------------------------

  void publish_latched(const std::string& port, const idl::Bytes& bytes) override {
    outputs_.at(port)->write(bytes);
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

  FrameHeader header() const override {
    return {.graph = graph_.graph,
            .stage = node_.name,
            .generation = generation_,
            .stamp = wall_nanoseconds()};
  }

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

  int frame_depth() const { return 2 * graph_.window + 2; }

  void open_writers() {
    const EndpointQos frames{.depth = frame_depth()};
    for (const auto& port : stage_->outputs())
      outputs_[port.name] = participant_.writer(
          topic_name(graph_, node_.name, port.name), port.type,
          port.latched ? EndpointQos{.depth = static_cast<int>(kModelsKept)} : frames);
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

  void open_readers() {
    const EndpointQos frames{.depth = frame_depth()};
    for (const auto& input : node_.inputs) {
      const PortInfo& info = input_info(input.port);
      const std::string topic = topic_name(graph_, input.from_stage, input.from_port);
      if (info.latched)
        read(topic, info.type, {.depth = static_cast<int>(kModelsKept)},
             [this, port = input.port](const FrameHeader& header, Sample sample) {
               auto& newest = latched_[port];
               newest.push_back({header.model_id, std::move(sample)});
               if (newest.size() > kModelsKept) newest.pop_front();
             });
      else
        read(topic, info.type, frames,
             [this, port = input.port](const FrameHeader& header, Sample sample) {
               join_.add(port, header, std::move(sample));
             });
    }
    if (source_ != nullptr)
      open_source_readers(frames);
    else
      open_stream_readers(frames);
  }

  void open_stream_readers(const EndpointQos& frames) {
    read(control_topic(graph_, "frame_failure"), "FrameFailure", frames,
         [this](const FrameHeader& header, const Sample& sample) {
           if (header.stage == node_.name || !upstream_.contains(header.stage)) return;
           join_.fail(header, header.stage, idl::decode<idl::FrameFailure>(*sample).reason);
         });
    read(control_topic(graph_, "stream_end"), "StreamEnd", {.depth = 1},
         [this](const FrameHeader& header, const Sample& sample) {
           join_.end(header, idl::decode<idl::StreamEnd>(*sample).count);
         });
  }

  void open_source_readers(const EndpointQos& frames) {
    read(control_topic(graph_, "frame_done"), "FrameDone", frames,
         [this](const FrameHeader& header, const Sample& sample) {
           if (header.epoch == epoch_)
             ledger_.done(header.stage, header, idl::decode<idl::FrameDone>(*sample));
         });
    read(control_topic(graph_, "stage_status"), "StageStatus", {.depth = 1},
         [this](const FrameHeader& header, const Sample& sample) {
           at_work_[header.stage] = {
               header.sequence, idl::decode<idl::StageStatus>(*sample).state == State::working};
         });
  }

  // Calls `take` under the lock with every well-formed message of a topic.
  void read(const std::string& topic, const std::string& type, const EndpointQos& qos,
            std::function<void(const FrameHeader&, Sample)> take) {
    readers_.push_back(
        participant_.reader(topic, type, qos, [this, take = std::move(take)](Sample sample) {
          try {
            const FrameHeader header = idl::decode_header(*sample);
            const std::scoped_lock lock(mutex_);
            take(header, std::move(sample));
          } catch (const Error&) {
            // A stranger's; one of a stage of ours is missed by the deadline.
          }
          changed_.notify_all();
        }));
  }

  // -- worker ------------------------------------------------------------------------------------

  void work() {
    try {
      if (source_ != nullptr)
        admit_frames();
      else if (!join_is_empty())
        take_frames();
      else
        set_state(State::waiting, "");
    } catch (const std::exception& error) {
      set_state(State::failed, error.what());
    }
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_; });
  }

  bool join_is_empty() const { return frame_inputs().empty(); }

  void take_frames() {
    set_state(State::waiting, "");
    for (;;) {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return stop_ || join_.ready(); });
      if (stop_) return;
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
    header.generation = generation_;
    return header;
  }

  // Works on one frame and publishes its outputs, or its failure.
  void process(const FrameHeader& header, std::map<std::string, Sample> inputs) {
    begin_frame(header);
    const auto start = Clock::now();
    std::string reason;
    try {
      add_latched(header.model_id, inputs);
      Frame frame(header, std::move(inputs));
      stage_->process(frame);
      for (const auto& [port, bytes] : frame.outputs()) outputs_.at(port)->write(bytes);
    } catch (const std::exception& error) {
      reason = error.what();
      if (reason.empty()) reason = "unknown error";
    }
    end_frame(std::chrono::duration<double, std::milli>(Clock::now() - start).count(),
              !reason.empty());
    if (!reason.empty()) failure_writer_->write(idl::encode(header, idl::FrameFailure{reason}));
    publish_done(header, reason.empty() ? idl::FrameDone{.outcome = stage_->leaf_outcome()}
                                        : idl::FrameDone{Outcome::failed, node_.name, reason});
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
    {
      const std::scoped_lock lock(mutex_);
      header.epoch = epoch_ = static_cast<std::uint64_t>(wall_nanoseconds());
    }
    set_state(State::waiting, "");
    auto due = Clock::now();
    while (const auto name = source_->next()) {
      if (!await_room(due)) continue;
      if (stopping()) break;
      header.name = *name;
      header.stamp = wall_nanoseconds();
      header.model_id = newest_model(header.model_id);
      {
        const std::scoped_lock lock(mutex_);
        ledger_.admit(header, Clock::now());
      }
      process(header, {});
      ++header.sequence;
    }
    if (stopping()) return;
    end_writer_->write(idl::encode(header, idl::StreamEnd{header.sequence}));
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_ || ledger_.ended(); });
    if (stop_) return;
    const std::string failure = ledger_.end_failure();
    lock.unlock();
    set_state(failure.empty() ? State::finished : State::failed, failure);
  }

  // Waits until a frame may be admitted. With a rate, `due` is when the frame arrives and moves on
  // by one period; false if the frame was dropped, as the next one arrived before there was room.
  bool await_room(Clock::time_point& due) {
    std::unique_lock lock(mutex_);
    const auto may_go = [this] { return stop_ || ledger_.has_room(); };
    if (source_->rate() <= 0.0) {
      changed_.wait(lock, may_go);
      return true;
    }
    changed_.wait_until(lock, due, [this] { return stop_; });
    due += std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(1.0 / source_->rate()));
    if (!source_->drop_when_full()) {
      changed_.wait(lock, may_go);
      return true;
    }
    if (changed_.wait_until(lock, due, may_go)) return true;
    ledger_.drop();
    return false;
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
    for (const auto& [stage, work] : at_work_)
      if (work.second && work.first == header.sequence)
        stages += (stages.empty() ? "" : ", ") + stage;
    return stages.empty() ? "an unknown stage" : stages;
  }

  // -- status ------------------------------------------------------------------------------------

  void begin_frame(const FrameHeader& header) {
    const std::scoped_lock lock(mutex_);
    frame_ = header;
    status_.state = State::working;
    ++status_.frames_in;
  }

  void end_frame(double milliseconds, bool failed) {
    const std::scoped_lock lock(mutex_);
    status_.state = State::waiting;
    ++(failed ? status_.frames_failed : status_.frames_out);
    latencies_.add(milliseconds);
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
    status.latency_median = latencies_.quantile(0.5);
    status.latency_p99 = latencies_.quantile(0.99);
    status.latency_sum = latencies_.sum();
    status.cpu_seconds = process_cpu_seconds();
    status.memory = resident_bytes();
    status.account = ledger_.account();
    return status;
  }

  void publish_status() {
    std::unique_lock lock(mutex_);
    const idl::StageStatus status = current_status();
    FrameHeader header = this->header();
    header.source = frame_.source;
    header.epoch = frame_.epoch;
    header.sequence = frame_.sequence;
    header.name = frame_.name;
    header.model_id = frame_.model_id;
    lock.unlock();
    status_writer_->write(idl::encode(header, status));
  }

  void tick() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
      changed_.wait_for(lock, kStatusPeriod, [this] { return stop_; });
      lock.unlock();
      try {
        if (source_ != nullptr) check_deadlines();
        publish_status();
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
  const std::uint32_t generation_;
  const bool is_leaf_;
  const std::set<std::string> upstream_;

  mutable std::mutex mutex_;  // guards what follows, up to participant_
  std::condition_variable changed_;
  bool stop_ = false;
  Join join_;
  Ledger ledger_;
  std::uint64_t epoch_ = 0;
  std::map<std::string, std::deque<std::pair<std::uint64_t, Sample>>> latched_;
  std::map<std::string, std::pair<std::uint64_t, bool>> at_work_;  // stage: sequence, working
  std::deque<std::pair<Clock::time_point, FrameHeader>> overdue_;
  idl::StageStatus status_;
  FrameHeader frame_;
  Latencies latencies_;

  Participant participant_;
  std::map<std::string, std::unique_ptr<Writer>> outputs_;
  std::unique_ptr<Writer> status_writer_;
  std::unique_ptr<Writer> failure_writer_;
  std::unique_ptr<Writer> done_writer_;
  std::unique_ptr<Writer> end_writer_;
  std::vector<std::unique_ptr<Reader>> readers_;
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
