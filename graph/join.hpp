// Brings the inputs of a frame together and releases frames in sequence.
//
// A frame is released when every port has delivered it, or when a failure upstream says that this
// will never happen (a tombstone). Messages are identified by (epoch, sequence, port); what comes
// twice or too late is ignored. A larger epoch ends the older one. Holds no thread and no DDS.
//
// Whoever writes on the topics can claim any frame: of frames that are too far ahead to be in
// flight only a bounded number and amount is kept, the nearest first.
//
// A stage that is started in the middle of a stream goes on at the first frame that is not over,
// which the source tells (settle); one in standby keeps what arrives until it is told where to
// begin (activate). Of a stage with replicas each releases its share of the frames and keeps the
// others' until they are over, to work them off if a replica is given up.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "graph/stage.hpp"

namespace cosegraph::graph {

// A place in a stream: frames of `epoch` from `sequence` on. Epoch 0: no frame was seen yet.
struct StreamPosition {
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;

  bool operator==(const StreamPosition&) const = default;
};

struct JoinOptions {
  enum class Start {
    beginning,  // sequence 0 of an epoch comes first, unless the source says that it is over
    resume,     // waits for the source to say which frames are over
    standby     // releases nothing before activate()
  };
  Start start = Start::beginning;
  int window = 4;  // frames in flight
  int replica = 0;
  int replicas = 1;
};

class Join {
 public:
  struct Released {
    enum class Kind { frame, failed, ended } kind;
    idl::FrameHeader header;
    std::map<std::string, Sample> inputs;  // frame
    std::string failed_stage;              // failed
    std::string reason;                    // failed
  };

  explicit Join(std::vector<std::string> ports, const JoinOptions& options = {});

  void add(const std::string& port, const idl::FrameHeader& header, Sample sample);
  void fail(const idl::FrameHeader& header, std::string stage, std::string reason);
  void end(const idl::FrameHeader& header, std::uint64_t count);

  // Frames before `position` are over for the whole graph; what is kept of them is dropped.
  void settle(const StreamPosition& position);
  // Ends standby: goes on at `position`. With epoch 0, as after a resumption.
  void activate(const StreamPosition& position);
  // Ends the wait of a resumption: goes on with the first frame that can be completed.
  void resume_anyway();
  // Replicas that are given up: their frames fall to the next one.
  void give_up(int replica, bool gone);

  // The next in sequence, if it is complete.
  std::optional<Released> take();
  bool ready() const;

  // The first frame that has not been released.
  StreamPosition position() const { return {epoch_, next_sequence()}; }
  // Frames that are begun or wait for their turn, of this replica's share.
  std::size_t waiting() const;
  std::uint64_t ignored() const { return ignored_; }

 private:
  enum class Mode { running, resuming, anyway, standby };
  struct Slot {
    idl::FrameHeader header;
    std::map<std::string, Sample> inputs;
    bool failed = false;
    std::string stage;
    std::string reason;
  };

  bool adopt(std::uint64_t epoch);
  bool is_complete(const Slot& slot) const { return slot.failed || slot.inputs.size() == ports_; }
  Slot* slot_of(const idl::FrameHeader& header);
  bool is_mine(std::uint64_t sequence) const;
  std::uint64_t next_sequence() const;
  void raise_floor(std::uint64_t sequence);
  void shed();
  void find_start();

  std::size_t ports_;
  JoinOptions options_;
  Mode mode_;
  std::set<std::string> seen_ports_;  // in this epoch; only while the start is looked for
  std::vector<bool> gone_;            // replicas
  std::uint64_t epoch_ = 0;
  std::uint64_t floor_ = 0;           // frames before it are over or released
  std::set<std::uint64_t> released_;  // at floor_ or behind
  std::map<std::uint64_t, Slot> slots_;
  std::optional<std::uint64_t> count_;
  idl::FrameHeader end_header_;
  bool ended_ = false;
  bool told_ = false;  // the source has said in this epoch which frames are over
  std::uint64_t ignored_ = 0;
};

}  // namespace cosegraph::graph
