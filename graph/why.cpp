#include "graph/why.hpp"

#include <algorithm>
#include <cstdio>

#include "graph/control.hpp"

template <>
cosegraph::Names<cosegraph::graph::Verdict> cosegraph::names<cosegraph::graph::Verdict>() {
  using enum graph::Verdict;
  static constexpr std::pair<graph::Verdict, std::string_view> kTable[] = {
      {fine, "fine"}, {broken, "broken"}, {unknown, "unknown"}};
  return kTable;
}

namespace cosegraph::graph {
namespace {

using idl::State;

constexpr double kSilentAfter = 2.0;  // s without a status

// What all processes of a stage count together.
struct Counts {
  std::uint64_t messages = 0;  // on the port in question
  std::uint64_t frames_in = 0;
  std::uint64_t frames_out = 0;
  std::uint64_t failed = 0;
  std::uint64_t queue = 0;
};

std::string number(std::uint64_t value) {
  return std::to_string(value);
}

std::string plural(std::uint64_t count, const std::string& word) {
  return number(count) + " " + word + (count == 1 ? "" : "s");
}

class Walk {
 public:
  explicit Walk(const Question& question)
      : q_(question), topic_(topic_name(q_.graph, q_.input.from_stage, q_.input.from_port)) {}

  std::vector<Link> links() {
    process(q_.input.from_stage);
    process(q_.stage.name);
    participant(q_.input.from_stage);
    participant(q_.stage.name);
    topic();
    policies();
    sent();
    received();
    if (!q_.latched) joined();
    accepted();
    return std::move(links_);
  }

 private:
  void fine(std::string name, std::string text) {
    links_.push_back({std::move(name), Verdict::fine, std::move(text), ""});
  }
  void broken(std::string name, std::string text, std::string remedy) {
    links_.push_back({std::move(name), Verdict::broken, std::move(text), std::move(remedy)});
  }
  void unknown(std::string name, std::string text) {
    links_.push_back({std::move(name), Verdict::unknown, std::move(text), ""});
  }

  // -- who runs ----------------------------------------------------------------------------------

  void process(const std::string& stage) {
    const StageNode* node = q_.graph.stage(stage);
    if (node == nullptr) return broken("process", "there is no stage '" + stage + "'", "");
    const std::string start = "cosegraph start " + stage + " --graph " + q_.graph.graph;
    std::string text;
    for (std::uint32_t i = 0; i < hosts_of(*node).size(); ++i) {
      const std::string name = process_name(*node, i);
      const auto found = q_.look.find(name);
      if (found == q_.look.end() && is_present(stage))
        return unknown("process", name + " is there, but nothing is heard of it");
      if (found == q_.look.end())
        return broken("process", "nobody has heard of " + name,
                      "start the graph, or this stage: " + start);
      const Observed& seen = found->second;
      const double silent = std::chrono::duration<double>(q_.now - seen.heard).count();
      if (seen.status.state == State::failed)
        return broken("process", name + " has failed: " + seen.status.activity,
                      "see what it has printed: cosegraph logs " + stage);
      if (seen.status.state == State::stopped)
        return broken("process", name + " was stopped", start);
      if (silent > kSilentAfter) {
        char seconds[24];
        std::snprintf(seconds, sizeof seconds, "%.1f s", silent);
        return broken("process", name + " is silent for " + seconds,
                      "its process is gone or suspended, or its host cannot be reached: "
                      "cosegraph ps");
      }
      text += (text.empty() ? "" : ", ") + name + " runs on " + seen.status.host + ", process " +
              number(seen.status.pid) + ", " + std::string(to_name(seen.status.state));
      if (!seen.status.activity.empty()) text += " (" + seen.status.activity + ")";
    }
    fine("process", text);
  }

  bool is_of(const Endpoint& endpoint, const std::string& stage) const {
    const auto peer = q_.domain.peers.find(endpoint.participant);
    return peer != q_.domain.peers.end() && peer->second.name == q_.graph.graph + "/" + stage;
  }

  bool is_present(const std::string& stage) const {
    return std::ranges::any_of(q_.domain.peers, [&](const auto& peer) {
      return peer.second.name == q_.graph.graph + "/" + stage;
    });
  }

  void participant(const std::string& stage) {
    if (is_present(stage))
      return fine("participant", q_.graph.graph + "/" + stage + " is in DDS domain " +
                                     std::to_string(q_.graph.dds.domain));
    broken("participant",
           q_.graph.graph + "/" + stage + " is not found in DDS domain " +
               std::to_string(q_.graph.dds.domain),
           "domain and discovery of the graph files may differ, or discovery does not get "
           "through: cosegraph doctor");
  }

  // -- the topic ---------------------------------------------------------------------------------

  // Of the stages in question; others that use the topic do not help.
  void topic() {
    for (const auto& endpoint : q_.domain.endpoints) {
      if (endpoint.topic != topic_) continue;
      if (endpoint.is_writer && is_of(endpoint, q_.input.from_stage)) writers_.push_back(&endpoint);
      if (!endpoint.is_writer && is_of(endpoint, q_.stage.name)) readers_.push_back(&endpoint);
    }
    keep_own(writers_);
    keep_own(readers_);
    const std::string remedy = "the process runs another version of the graph file: restart it";
    if (writers_.empty())
      return broken("topic", q_.input.from_stage + " has no writer for " + topic_, remedy);
    if (readers_.empty())
      return broken("topic", q_.stage.name + " has no reader for " + topic_, remedy);
    fine("topic", topic_ + " has " + plural(writers_.size(), "writer") + " and " +
                      plural(readers_.size(), "reader") + " of these stages");
  }

  // Those of this run, if there are any: others of the same name belong to other runs.
  void keep_own(std::vector<const Endpoint*>& endpoints) const {
    const auto is_own = [&](const Endpoint* endpoint) {
      return endpoint->partitions == std::vector<std::string>{partition_of(q_.graph)};
    };
    if (std::ranges::any_of(endpoints, is_own))
      std::erase_if(endpoints, [&](const Endpoint* endpoint) { return !is_own(endpoint); });
  }

  // Why the best pair does not match; nothing if one does.
  std::vector<std::string> reasons() const {
    std::vector<std::string> fewest;
    for (const auto* writer : writers_)
      for (const auto* reader : readers_) {
        auto found = mismatches(*writer, *reader);
        if (found.empty()) return {};
        if (fewest.empty() || found.size() < fewest.size()) fewest = std::move(found);
      }
    return fewest;
  }

  // Type, keys, partition and every policy, each a link of its own.
  void policies() {
    if (writers_.empty() || readers_.empty()) return unknown("match", "one side is missing");
    const std::vector<std::string> reasons = this->reasons();
    for (const std::string policy :
         {"type", "keys", "partition", "reliability", "durability", "deadline", "ownership",
          "liveliness", "lease of liveliness"}) {
      const auto reason = std::ranges::find_if(
          reasons, [&](const std::string& text) { return text.starts_with(policy + ": "); });
      if (reason != reasons.end())
        broken(policy, reason->substr(policy.size() + 2), policy_remedy(policy));
      else
        fine(policy, agreement(policy));
    }
    if (reasons.empty())
      fine("match", "writer and reader match");
    else
      broken("match", "writer and reader do not match", "see above");
  }

  std::string agreement(const std::string& policy) const {
    const Endpoint& writer = *writers_.front();
    if (policy == "type") return writer.type;
    if (policy == "partition") return partition_of(q_.graph);
    if (policy == "reliability") return writer.qos.reliable ? "reliable" : "best_effort";
    if (policy == "durability") return std::string(to_name(writer.qos.durability));
    return "compatible";
  }

  static std::string policy_remedy(const std::string& policy) {
    if (policy == "type" || policy == "keys")
      return "the stages were built from different versions of the message types: build both "
             "alike";
    if (policy == "partition")
      return "the stages belong to different runs: give both the same --instance, or stop the "
             "older run";
    return "one of the stages is no stage of this program, or of another version: its QoS must be "
           "that of ARCHITECTURE.md";
  }

  // -- messages ----------------------------------------------------------------------------------

  Counts counts_of(const std::string& stage, const std::string& port, bool output) const {
    Counts counts;
    for (const auto& [process, seen] : q_.look) {
      if (seen.header.stage != stage) continue;
      counts.frames_in += seen.status.frames_in;
      counts.frames_out += seen.status.frames_out;
      counts.failed += seen.status.frames_failed;
      counts.queue += seen.status.queue;
      for (const auto& traffic : seen.status.ports)
        if (traffic.output == output && traffic.name == port) counts.messages += traffic.messages;
    }
    return counts;
  }

  bool is_heard(const std::string& stage) const {
    return std::ranges::any_of(q_.look,
                               [&](const auto& seen) { return seen.second.header.stage == stage; });
  }

  void sent() {
    const std::string& from = q_.input.from_stage;
    if (!is_heard(from)) return unknown("sent", "nothing is heard of " + from);
    const Counts writer = counts_of(from, q_.input.from_port, true);
    sent_ = writer.messages;
    if (sent_ > 0) return fine("sent", plural(sent_, "message"));
    std::string remedy;
    if (const StageNode* node = q_.graph.stage(from))
      for (const auto& input : node->inputs)
        remedy += (remedy.empty() ? "look further up: cosegraph why " : ", ") + q_.graph.graph +
                  " " + from + "/" + input.port;
    broken("sent",
           from + " has written nothing on '" + q_.input.from_port + "': it has begun " +
               plural(writer.frames_in, "frame") + ", " + number(writer.failed) + " failed" +
               newest_failure(from),
           remedy);
  }

  void received() {
    if (!is_heard(q_.stage.name))
      return unknown("received", "nothing is heard of " + q_.stage.name);
    received_ = counts_of(q_.stage.name, q_.input.port, false).messages;
    if (received_ > 0) return fine("received", plural(received_, "message"));
    if (sent_ == 0) return unknown("received", "nothing was sent");
    broken("received", "nothing has arrived of " + plural(sent_, "message"),
           "messages are lost on the way: firewall, MTU or socket buffers; cosegraph doctor");
  }

  // Frames begin when all inputs have delivered.
  void joined() {
    if (!is_heard(q_.stage.name)) return unknown("joined", "nothing is heard of " + q_.stage.name);
    const Counts reader = counts_of(q_.stage.name, q_.input.port, false);
    if (reader.frames_in > 0)
      return fine("joined", plural(reader.frames_in, "frame") + " begun, " + number(reader.queue) +
                                " waiting");
    if (received_ == 0) return unknown("joined", "nothing was received");
    std::string missing;
    std::string remedy;
    for (const auto& input : q_.stage.inputs) {
      if (counts_of(q_.stage.name, input.port, false).messages > 0) continue;
      missing += (missing.empty() ? "" : ", ") + input.port;
      remedy += (remedy.empty() ? "cosegraph why " : ", ") + q_.graph.graph + " " + q_.stage.name +
                "/" + input.port;
    }
    if (missing.empty())
      broken("joined", plural(reader.queue, "frame") + " waiting, none begun",
             "the inputs do not carry the same frames: cosegraph topic echo them, --field header");
    else
      broken("joined", plural(reader.queue, "frame") + " waiting for other inputs: " + missing,
             remedy);
  }

  void accepted() {
    if (!is_heard(q_.stage.name))
      return unknown("accepted", "nothing is heard of " + q_.stage.name);
    const Counts reader = counts_of(q_.stage.name, q_.input.port, false);
    if (reader.frames_out > 0)
      return fine("accepted", plural(reader.frames_out, "frame") + " done, " +
                                  number(reader.failed) + " failed" +
                                  newest_failure(q_.stage.name));
    if (reader.failed > 0)
      return broken(
          "accepted",
          plural(reader.failed, "frame") + " failed, none done" + newest_failure(q_.stage.name),
          "see the reason; parameters and model must fit the data");
    unknown("accepted", reader.frames_in > 0 ? "the first frame is in work" : "no frame was begun");
  }

  std::string newest_failure(const std::string& stage) const {
    for (auto failure = q_.failures.rbegin(); failure != q_.failures.rend(); ++failure)
      if (failure->stage == stage)
        return "; the newest: " + failure->frame + ": " + failure->reason;
    return "";
  }

  const Question& q_;
  std::string topic_;
  std::vector<Link> links_;
  std::vector<const Endpoint*> writers_;
  std::vector<const Endpoint*> readers_;
  std::uint64_t sent_ = 0;
  std::uint64_t received_ = 0;
};

}  // namespace

std::vector<Link> links_of(const Question& question) {
  return Walk(question).links();
}

const Link* first_broken(const std::vector<Link>& links) {
  const auto found = std::ranges::find(links, Verdict::broken, &Link::verdict);
  return found == links.end() ? nullptr : &*found;
}

}  // namespace cosegraph::graph
