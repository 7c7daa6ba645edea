// What the author of a stage writes against. No DDS, no threads: a stage declares ports and
// parameters as members and turns one frame's inputs into its outputs; the runtime does the rest.
//
//   class SupervoxelsStage final : public graph::Stage {
//     graph::Input<Cloud> dense_{*this, "cloud", "what it takes"};
//     graph::Output<Supervoxels> out_{*this, "supervoxels", "what it gives"};
//     supervoxels::Params params_;
//    public:
//     Fields parameters() override { return describe(params_); }
//     void process(graph::Frame& frame) override {
//       out_.put(frame, supervoxels::compute(dense_.get(frame), params_));
//     }
//   };
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/fields.hpp"
#include "graph/stage_info.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph {

using Sample = std::shared_ptr<const idl::Bytes>;

// One frame at one stage: what came in, and what goes out once process() has returned.
class Frame {
 public:
  Frame(idl::FrameHeader header, std::map<std::string, Sample> inputs)
      : header_(std::move(header)), inputs_(std::move(inputs)) {}

  const idl::FrameHeader& header() const { return header_; }
  const std::string& name() const { return header_.name; }

  const idl::Bytes* input(const std::string& port) const {
    const auto found = inputs_.find(port);
    return found == inputs_.end() ? nullptr : found->second.get();
  }
  // The model of a latched port that belongs to this frame.
  Sample latched(const std::string& port) const {
    const auto found = inputs_.find(port);
    return found == inputs_.end() ? nullptr : found->second;
  }

  void put(const std::string& port, idl::Bytes bytes) { outputs_[port] = std::move(bytes); }
  const std::map<std::string, idl::Bytes>& outputs() const { return outputs_; }

 private:
  idl::FrameHeader header_;
  std::map<std::string, Sample> inputs_;
  std::map<std::string, idl::Bytes> outputs_;
};

// What a stage may ask of the runtime outside of a frame.
class StageHost {
 public:
  virtual ~StageHost() = default;
  virtual void publish_latched(const std::string& port, const idl::Bytes& bytes) = 0;
  virtual void report(std::string_view activity, double progress) = 0;
  virtual bool stopping() const = 0;
  // This process goes on where another one of the same stage ended.
  virtual bool resumed() const = 0;
  virtual idl::FrameHeader header() const = 0;
  // DDS domain of the graph.
  virtual int domain() const = 0;
};

class Stage {
 public:
  virtual ~Stage() = default;
  Stage() = default;
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  virtual std::string summary() const = 0;
  virtual Fields parameters() { return {}; }

  // Parameters are set. Throws to refuse; the graph then does not start.
  virtual void start() {}
  // Throws to fail this frame only.
  virtual void process(Frame& frame) = 0;
  // The stream is over and all of its frames have been processed or have failed.
  virtual void end() {}
  // What its outputs depend on and a model must fit (see core/fields.hpp); a stage is not replaced
  // by one of another recipe while frames flow. Asked for after start().
  virtual std::string recipe() { return ""; }
  // What a frame is to the account when this stage is a leaf.
  virtual idl::Outcome leaf_outcome() const { return idl::Outcome::labelled; }

  const std::vector<PortInfo>& inputs() const { return inputs_; }
  const std::vector<PortInfo>& outputs() const { return outputs_; }
  void attach(StageHost& host) { host_ = &host; }
  void connect(const std::string& input) { connected_.push_back(input); }

 protected:
  // Tells who watches what is going on; `progress` in 0 .. 1, negative if unknown.
  void report(std::string_view activity, double progress = -1.0) const {
    if (host_ != nullptr) host_->report(activity, progress);
  }
  // Long work ends early when this is true.
  bool stopping() const { return host_ != nullptr && host_->stopping(); }
  // Whether another process of this stage worked on the stream before: after a crash, or when a
  // stage is swapped.
  bool resumed() const { return host_ != nullptr && host_->resumed(); }
  int domain() const { return host_ == nullptr ? 0 : host_->domain(); }

 private:
  friend class PortBase;
  std::vector<PortInfo> inputs_;
  std::vector<PortInfo> outputs_;
  std::vector<std::string> connected_;
  StageHost* host_ = nullptr;
};

// Admits frames. next() names the frame to come, process() then makes its outputs: if it throws,
// the frame has been admitted and has failed.
class SourceStage : public Stage {
 public:
  virtual std::optional<std::string> next() = 0;
  // Frames per second at which frames arrive whether or not there is room; 0: as room allows.
  virtual double rate() const { return 0.0; }
  // With a rate: whether a frame is dropped when the next one is there and it could not be
  // admitted (else it waits).
  virtual bool drop_when_full() const { return false; }
  // Called once before next(): `count` frames have been taken by processes of this stage that came
  // before and are not to be taken again.
  virtual void skip(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count && !stopping(); ++i)
      if (!next()) return;
  }

  // -- A sensor's frames come when they come, and the newest counts --
  // Whether next() is asked for a frame only when there is room for it.
  virtual bool live() const { return false; }
  // Whether next() can answer; waits for it up to `patience`. Live sources only, as missed().
  virtual bool ready(std::chrono::milliseconds /*patience*/) { return true; }
  // Frames that have made way for newer ones since this was last asked; they count as dropped.
  virtual std::uint64_t missed() { return 0; }
  // Whether the stream goes on until somebody stops the graph. Asked for when parameters are set.
  virtual bool endless() const { return false; }
};

enum class Need { required, optional };

class PortBase {
 public:
  const std::string& name() const { return name_; }

 protected:
  PortBase(Stage& stage, PortInfo info, bool is_input) : stage_(&stage), name_(info.name) {
    (is_input ? stage.inputs_ : stage.outputs_).push_back(std::move(info));
  }
  bool is_connected() const {
    for (const auto& port : stage_->connected_)
      if (port == name_) return true;
    return false;
  }
  StageHost& host() const {
    if (stage_->host_ == nullptr) throw Error("port " + name_ + " is used outside of a graph");
    return *stage_->host_;
  }

 private:
  Stage* stage_;
  std::string name_;
};

template <class Value>
class Input : public PortBase {
 public:
  Input(Stage& stage, std::string name, std::string doc, Need need = Need::required)
      : PortBase(stage,
                 {.name = std::move(name),
                  .type = std::string(idl::type_name<Value>()),
                  .doc = std::move(doc),
                  .optional = need == Need::optional},
                 true) {}
  bool connected() const { return is_connected(); }
  // Throws InputError if the message is damaged.
  Value get(const Frame& frame) const {
    const idl::Bytes* bytes = frame.input(name());
    if (bytes == nullptr) throw Error("input " + name() + " is not connected");
    return idl::decode<Value>(*bytes);
  }
};

// A value that holds for many frames, chosen by the frame's model id.
template <class Value>
class LatchedInput : public PortBase {
 public:
  LatchedInput(Stage& stage, std::string name, std::string doc, Need need = Need::required)
      : PortBase(stage,
                 {.name = std::move(name),
                  .type = std::string(idl::type_name<Value>()),
                  .doc = std::move(doc),
                  .latched = true,
                  .optional = need == Need::optional},
                 true) {}
  bool connected() const { return is_connected(); }
  // Decoded once per model.
  std::shared_ptr<const Value> get(const Frame& frame) const {
    const Sample sample = frame.latched(name());
    if (sample == nullptr) throw Error("input " + name() + " is not connected");
    if (sample != sample_) {
      value_ = std::make_shared<const Value>(idl::decode<Value>(*sample));
      sample_ = sample;
    }
    return value_;
  }

 private:
  mutable Sample sample_;
  mutable std::shared_ptr<const Value> value_;
};

template <class Value>
class Output : public PortBase {
 public:
  Output(Stage& stage, std::string name, std::string doc)
      : PortBase(stage,
                 {.name = std::move(name),
                  .type = std::string(idl::type_name<Value>()),
                  .doc = std::move(doc)},
                 false) {}
  void put(Frame& frame, const Value& value) const {
    frame.put(name(), idl::encode(frame.header(), value));
  }
};

template <class Value>
class LatchedOutput : public PortBase {
 public:
  LatchedOutput(Stage& stage, std::string name, std::string doc)
      : PortBase(stage,
                 {.name = std::move(name),
                  .type = std::string(idl::type_name<Value>()),
                  .doc = std::move(doc),
                  .latched = true},
                 false) {}
  void put(const Value& value) const {
    idl::FrameHeader header = host().header();
    header.model_id = value.id;
    host().publish_latched(name(), idl::encode(header, value));
  }
};

using StageFactory = std::function<std::unique_ptr<Stage>()>;

// A stage's ports and parameters, as the graph checker needs them.
StageInfo info_of(const std::string& kind, const StageFactory& make);

// Kinds by name; the catalog for checking is made from it.
using StageTable = std::map<std::string, StageFactory>;
Catalog catalog_of(const StageTable& table);

}  // namespace cosegraph::graph
