#include "tools/recording/recorder.hpp"

#include <utility>

#include "graph/control.hpp"

namespace cosegraph::recording {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// Messages are written in batches: a thread that wakes up for each costs more than writing does.
constexpr auto kBatchPeriod = 50ms;
constexpr std::uint64_t kBatchBytes = 8U << 20U;
constexpr auto kFlushPeriod = 1s;   // so much is lost if the recorder is killed
constexpr auto kLastPatience = 2s;  // for messages still on their way at the end

std::uint64_t wall_nanoseconds() {
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                        std::chrono::system_clock::now().time_since_epoch())
                                        .count());
}

std::vector<bool> which_are_latched(const std::vector<Topic>& topics) {
  std::vector<bool> result;
  for (const auto& topic : topics) result.push_back(topic.latched);
  return result;
}

}  // namespace

Recorder::Recorder(const graph::GraphDescription& graph, const graph::Catalog& catalog,
                   const std::filesystem::path& file, const RecorderOptions& options)
    : topics_(choose(topics_of(graph, catalog), options.topics)),
      recording_(file, graph, topics_, options.file),
      memory_(options.memory),
      started_(Clock::now()),
      started_at_(wall_nanoseconds()),
      lost_(topics_.size()),
      heard_(topics_.size()),
      history_(graph::frame_history(graph)),
      source_(graph::source_of(graph, catalog).name),
      participant_(graph, graph.graph + "/recorder") {
  if (options.last)
    ring_.emplace(which_are_latched(topics_),
                  static_cast<std::uint64_t>(std::chrono::nanoseconds(*options.last).count()),
                  options.ring_memory);
  recording_.flush();  // the channels, whatever comes
  writer_ = std::thread([this] { work(); });
  for (std::size_t i = 0; i < topics_.size(); ++i)
    readers_.push_back(
        participant_.reader(topics_[i].name, topics_[i].type, qos_of(topics_[i], graph),
                            [this, i](graph::Sample sample) { receive(i, std::move(sample)); }));
}

Recorder::~Recorder() {
  readers_.clear();
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (writer_.joinable()) writer_.join();
}

void Recorder::receive(std::size_t topic, graph::Sample sample) {
  try {
    const idl::FrameHeader header = idl::decode_header(*sample);
    const std::scoped_lock lock(mutex_);
    if (stop_ || full_ || error_) return;
    if (topics_[topic].type == idl::type_name<idl::StageStatus>() && header.stage == source_) {
      const auto state = idl::decode<idl::StageStatus>(*sample).state;
      source_finished_ = state == idl::State::finished || state == idl::State::failed;
    }
    heard_[topic] = true;
    const std::uint64_t size = sample->size();
    if (queued_bytes_ + size > memory_ && !queue_.empty()) {
      ++lost_[topic];
      ++progress_.lost;
      return;
    }
    // The clock does not jump, so that a replay keeps the distances. Taken under the lock, times
    // ascend.
    const auto since =
        std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - started_);
    queue_.push_back(
        {topic, started_at_ + static_cast<std::uint64_t>(since.count()), std::move(sample)});
    queued_bytes_ += size;
    ++progress_.messages;
    progress_.bytes += size;
    if (queued_bytes_ > kBatchBytes) changed_.notify_all();
  } catch (const Error&) {
    return;  // a stranger's message
  }
}

void Recorder::work() {
  Tally heard(topics_, history_);
  auto flushed = Clock::now();
  bool judged = false;  // at least once since the end began
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait_for(lock, kBatchPeriod,
                      [&] { return stop_ || queued_bytes_ > kBatchBytes || ending_ != judged; });
    if (stop_ && queue_.empty()) return;
    std::deque<Entry> batch = std::exchange(queue_, {});
    const bool source_finished = source_finished_;
    const bool ending = judged = ending_;
    lock.unlock();
    std::uint64_t bytes = 0;
    std::exception_ptr error;
    try {
      for (const auto& entry : batch) {
        if (recording_.full()) break;
        bytes += entry.sample->size();
        heard.add(entry.topic, *entry.sample);
        write(entry);
      }
      if (Clock::now() - flushed > kFlushPeriod) {
        recording_.flush();
        flushed = Clock::now();
      }
    } catch (const std::exception&) {
      error = std::current_exception();
    }
    const bool whole = source_finished && heard.has_whole_stream();
    const bool missing = ending && !heard.completeness().has_all();
    batch.clear();
    lock.lock();
    queued_bytes_ -= bytes;  // of no matter if not all were written: the queue ends below
    whole_ = whole;
    missing_ = missing || !ending;
    full_ = recording_.full();
    if (error) error_ = error;
    if (error_ || full_) {
      queue_.clear();
      queued_bytes_ = 0;
    }
    if (whole_ || ending || error_ || full_) changed_.notify_all();
  }
}

void Recorder::write(const Entry& entry) {
  if (ring_)
    ring_->push(entry);
  else
    recording_.write(entry);
}

bool Recorder::step(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  const auto over = [this] { return error_ != nullptr || full_ || (source_finished_ && whole_); };
  changed_.wait_for(lock, patience, over);
  if (source_finished_ && !finished_at_) finished_at_ = Clock::now();
  if (!source_finished_) finished_at_.reset();
  return !over() && !(finished_at_ && Clock::now() - *finished_at_ > kLastPatience);
}

Recorder::Progress Recorder::progress() const {
  const std::scoped_lock lock(mutex_);
  Progress progress = progress_;
  for (std::size_t i = 0; i < topics_.size(); ++i)
    if (!heard_[i] && !topics_[i].is_control()) progress.silent.push_back(topics_[i].name);
  return progress;
}

std::string Recorder::reason(const std::string& otherwise) const {
  if (full_) return "the file has its size";
  if (ring_ && ring_->was_full()) return "as far back as memory reached";
  if (source_finished_) return "the stream is over";
  return otherwise;
}

Recorder::Result Recorder::finish(const std::string& otherwise) {
  {
    std::unique_lock lock(mutex_);
    ending_ = true;
    changed_.notify_all();
    changed_.wait_for(lock, kLastPatience,
                      [this] { return error_ || full_ || !missing_ || progress_.lost > 0; });
  }
  readers_.clear();
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (writer_.joinable()) writer_.join();
  if (error_) std::rethrow_exception(error_);
  if (ring_)
    for (const auto& entry : ring_->entries()) recording_.write(entry);
  recording_.close(reason(otherwise), lost_);
  return {.files = recording_.files(), .completeness = recording_.completeness()};
}

}  // namespace cosegraph::recording
