// Brings the inputs of a frame together and releases frames in sequence.
//
// A frame is released when every port has delivered it, or when a failure upstream says that this
// will never happen (a tombstone). Messages are identified by (epoch, sequence, port); what comes
// twice or too late is ignored. A larger epoch ends the older one. Holds no thread and no DDS.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "graph/stage.hpp"

namespace cosegraph::graph {

class Join {
 public:
  struct Released {
    enum class Kind { frame, failed, ended } kind;
    idl::FrameHeader header;
    std::map<std::string, Sample> inputs;  // frame
    std::string failed_stage;              // failed
    std::string reason;                    // failed
  };

  // `resume`: this stage was started in the middle of a stream and begins with the first frame
  // that it can complete; otherwise sequence 0 of an epoch comes first.
  explicit Join(std::vector<std::string> ports, bool resume = false);

  void add(const std::string& port, const idl::FrameHeader& header, Sample sample);
  void fail(const idl::FrameHeader& header, std::string stage, std::string reason);
  void end(const idl::FrameHeader& header, std::uint64_t count);

  // The next in sequence, if it is complete.
  std::optional<Released> take();
  bool ready() const;

  // Frames that are begun but not complete.
  std::size_t waiting() const { return slots_.size(); }
  std::uint64_t ignored() const { return ignored_; }

 private:
  struct Slot {
    idl::FrameHeader header;
    std::map<std::string, Sample> inputs;
    bool failed = false;
    std::string stage;
    std::string reason;
  };

  bool adopt(const idl::FrameHeader& header);
  bool is_complete(const Slot& slot) const { return slot.failed || slot.inputs.size() == ports_; }
  Slot* slot_of(const idl::FrameHeader& header);
  std::optional<std::uint64_t> next_sequence() const;

  std::size_t ports_;
  bool resume_;
  std::set<std::string> seen_ports_;  // in this epoch; only while resuming
  std::uint64_t epoch_ = 0;
  std::uint64_t next_ = 0;
  std::map<std::uint64_t, Slot> slots_;
  std::optional<std::uint64_t> count_;
  idl::FrameHeader end_header_;
  bool ended_ = false;
  std::uint64_t ignored_ = 0;
};

}  // namespace cosegraph::graph
