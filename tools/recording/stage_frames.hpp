// The frames of one stage in a recording, one by one: what it took and what it gave.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "graph/stage.hpp"
#include "tools/recording/mcap_reader.hpp"
#include "tools/recording/topics.hpp"

namespace cosegraph::recording {

struct RecordedFrame {
  idl::FrameHeader header;                       // as the stage wrote or would have written it
  std::uint64_t time = 0;                        // when its last input was recorded
  std::map<std::string, graph::Sample> inputs;   // by port, the frame's models included
  std::map<std::string, graph::Sample> outputs;  // by port, without models
  std::optional<std::string> failure;            // the reason, if the stage failed it
  std::string failed_before;                     // a stage upstream that failed it; else empty
  std::vector<std::string> lacking;              // connected inputs that were not recorded
};

// What a stage is connected to, as far as it is about frames and models.
struct StageWiring {
  std::string stage;
  std::map<std::string, std::string> frame_inputs;   // port: topic
  std::map<std::string, std::string> model_inputs;   // port: topic
  std::map<std::string, std::string> frame_outputs;  // port: topic
  std::map<std::string, std::string> types;          // of these ports' messages
};

// Throws ParameterError if the graph has no such stage.
StageWiring wiring_of(const graph::GraphDescription& graph, const std::string& stage,
                      const graph::StageInfo& info);

// Frames come in their order. One that the recording does not have in full is handed out when the
// frames behind it show that nothing more will come.
class StageFrames {
 public:
  enum class Want { inputs, inputs_and_outputs };

  // Reads the models first. Throws InputError naming the topics that were not recorded. The reader
  // must outlive it.
  StageFrames(const McapReader& reader, StageWiring wiring, Want want, int window,
              std::uint64_t from, std::uint64_t to);

  // The next frame that reached the stage or would have, or none at the end. Throws InputError if
  // the file is damaged.
  std::optional<RecordedFrame> next();

  // All models of an input, in their order.
  const std::vector<std::pair<std::uint64_t, graph::Sample>>& models(
      const std::string& port) const {
    return models_.at(port);
  }

 private:
  using Identity = std::pair<std::uint64_t, std::uint64_t>;  // epoch, sequence

  void read_models(const McapReader& reader);
  bool read_message();
  bool front_is_done() const;
  RecordedFrame take_front();

  StageWiring wiring_;
  Want want_;
  std::uint64_t window_;
  std::vector<std::string> upstream_;
  std::map<std::uint16_t, std::string> input_of_;   // channel: port
  std::map<std::uint16_t, std::string> output_of_;  // channel: port
  std::optional<std::uint16_t> failures_;           // channel
  std::optional<McapReader::Messages> messages_;
  std::map<std::string, std::vector<std::pair<std::uint64_t, graph::Sample>>> models_;  // by port
  std::map<Identity, RecordedFrame> open_;
  std::optional<Identity> newest_;
  std::optional<Identity> handed_out_;
  bool at_end_ = false;
};

}  // namespace cosegraph::recording
