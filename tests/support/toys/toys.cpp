// Small stages for tests of the runtime, one program each: TOY is numbers, add or keep.
//
//   numbers: 0, 1, 2, ... as clouds of one point      add: the number plus something
//   keep: a leaf that writes the sum of its inputs to a file named after the frame
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "graph/stage_main.hpp"

namespace cosegraph::toys {
namespace {

Cloud number(double value, int points) {
  Cloud cloud{.height = 1};
  cloud.xyz.assign(3 * static_cast<std::size_t>(points), static_cast<float>(value));
  cloud.width = static_cast<std::uint32_t>(points);
  return cloud;
}

class Numbers final : public graph::SourceStage {
 public:
  std::string summary() const override { return "0, 1, 2, ..."; }
  Fields parameters() override {
    return {integer_field("count", count_, 0, 1000000, "", "how many"),
            number_field("rate", rate_, 0, 10000, "Hz", "arrival"),
            integer_field("points", points_, 1, 10000000, "", "per cloud")};
  }
  std::optional<std::string> next() override {
    if (at_ == count_) return std::nullopt;
    return "n" + std::to_string(at_++);
  }
  void process(graph::Frame& frame) override { out_.put(frame, number(at_ - 1, points_)); }
  double rate() const override { return rate_; }

 private:
  graph::Output<Cloud> out_{*this, "out", ""};
  int count_ = 10;
  int at_ = 0;
  double rate_ = 0.0;
  int points_ = 1;
};

class Add final : public graph::Stage {
 public:
  std::string summary() const override { return "adds to every number"; }
  Fields parameters() override {
    return {number_field("value", value_, -1e6, 1e6, "", "what is added"),
            number_field("sleep", sleep_, 0, 10000, "ms", "per frame"),
            integer_field("die_at", die_at_, -1, 1000000, "", "number that kills the process"),
            integer_field("throw_at", throw_at_, -1, 1000000, "", "number that fails"),
            boolean_field("refuse", refuse_, "to start"),
            text_field("recipe", recipe_, "of what it gives")};
  }
  void start() override {
    if (refuse_) throw InputError("refuse: as told");
  }
  std::string recipe() override { return recipe_; }
  void process(graph::Frame& frame) override {
    const Cloud in = in_.get(frame);
    const int value = static_cast<int>(in.xyz[0]);
    if (value == die_at_) ::kill(::getpid(), SIGKILL);
    if (value == throw_at_) throw InputError("no luck");
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(sleep_));
    out_.put(frame, number(in.xyz[0] + value_, static_cast<int>(in.size())));
  }

 private:
  graph::Input<Cloud> in_{*this, "in", ""};
  graph::Output<Cloud> out_{*this, "out", ""};
  double value_ = 1.0;
  double sleep_ = 0.0;
  int die_at_ = -1;
  int throw_at_ = -1;
  bool refuse_ = false;
  std::string recipe_;
};

class Keep final : public graph::Stage {
 public:
  std::string summary() const override { return "writes sums to files"; }
  Fields parameters() override { return {text_field("folder", folder_, "where to")}; }
  void start() override { std::filesystem::create_directories(folder_); }
  void process(graph::Frame& frame) override {
    double sum = a_.get(frame).xyz[0];
    if (b_.connected()) sum += b_.get(frame).xyz[0];
    const std::filesystem::path file = std::filesystem::path(folder_) / frame.name();
    std::ofstream(file.string() + ".new") << sum;
    std::filesystem::rename(file.string() + ".new", file);
  }

 private:
  graph::Input<Cloud> a_{*this, "a", ""};
  graph::Input<Cloud> b_{*this, "b", "", graph::Need::optional};
  std::string folder_;
};

}  // namespace
}  // namespace cosegraph::toys

int main(int argc, char** argv) {
  using namespace cosegraph;
  const std::string kind = TOY;
  const auto make = [&]() -> std::unique_ptr<graph::Stage> {
    if (kind == "numbers") return std::make_unique<toys::Numbers>();
    if (kind == "add") return std::make_unique<toys::Add>();
    return std::make_unique<toys::Keep>();
  };
  return graph::stage_main(argc, argv, kind, make);
}
