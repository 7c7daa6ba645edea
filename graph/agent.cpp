#include "graph/agent.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <deque>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <thread>

#include "graph/control.hpp"
#include "graph/dds.hpp"
#include "graph/discovery_server.hpp"
#include "graph/figures.hpp"
#include "graph/observer.hpp"
#include "graph/runs.hpp"
#include "graph/supervisor.hpp"
#include "graph/swap.hpp"
#include "io/file.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using idl::ProcessState;
using idl::ReplyState;

constexpr auto kStatusPeriod = 100ms;
constexpr auto kForgetAfter = 30s;  // statuses of processes that are no more
constexpr auto kSilentAfter = 1s;   // an agent that says nothing is not there
constexpr auto kGoneAfter = 10s;    // and is not waited for any longer
constexpr auto kLeftover = 2s;      // a swap that nobody leads for so long is left over
constexpr auto kFarewell = 1000ms;  // for the last reply to be found and taken
constexpr std::size_t kReportsKept = 50'000;

// "NAME=VALUE"
std::pair<std::string, std::string> split_setting(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) throw ParameterError("'" + text + "' is not NAME=VALUE");
  return {text.substr(0, equals), text.substr(equals + 1)};
}

std::string one_line(const GraphError& error) {
  std::string text;
  for (const auto& fault : error.faults()) text += (text.empty() ? "" : "; ") + fault.message;
  return text;
}

std::string to_json(const SwapReport& report, const SwapRequest& request) {
  nlohmann::ordered_json json{{"stage", request.stage},
                              {"from_generation", request.old_generation},
                              {"to_generation", request.new_generation},
                              {"dry_run", request.dry_run},
                              {"took_ms", report.took_ms}};
  if (!request.dry_run)
    json.update({{"admitted", report.admitted},
                 {"done", report.finished},
                 {"failed", report.failed},
                 {"lost", report.lost},
                 {"doubled", report.doubled},
                 {"pause_ms", report.pause_ms},
                 {"usual_ms", report.usual_ms}});
  return json.dump();
}

}  // namespace

class Agent::Impl {
 public:
  Impl(const GraphDescription& graph, const Catalog& catalog, AgentOptions options)
      : options_(std::move(options)),
        catalog_(catalog),
        folder_(graph, options_.host),
        graph_(graph),
        source_(source_of(graph, catalog).name),
        wake_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
        supervisor_(
            supervisor_options(),
            [this](const std::string& stage, std::uint32_t replica,
                   const std::vector<std::string>& lines) { print(stage, replica, lines); }),
        discovery_server_(serves_discovery(graph_, options_.host)
                              ? std::make_unique<DiscoveryServer>(graph_.dds)
                              : nullptr),
        participant_(graph_,
                     graph_.graph + "/agent" + (options_.host.empty() ? "" : "/" + options_.host),
                     Identity::agent()) {
    adopted_ = supervisor_.adopt();
    if (adopted_ > 0)
      adopt_graph();
    else
      folder_.publish(graph_);
    open_topics();
    start_missing(view());
    publish_status();
  }

  ~Impl() {
    if (!left_) {
      supervisor_.stop_all(source_);
      publish_status();
      folder_.discard();
    }
    readers_.clear();
    ::close(wake_);
  }

  void step(std::chrono::milliseconds patience) {
    const auto until = Clock::now() + patience;
    do {
      const auto changed = supervisor_.attend(
          std::min<std::chrono::milliseconds>(
              kStatusPeriod / 2,
              std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now())),
          wake_);
      std::uint64_t count = 0;
      while (::read(wake_, &count, sizeof count) > 0) {
      }
      for (const auto& process : changed) speak_for(process);
      obey_orders();
      if (discovery_server_) say(discovery_server_->attend());
      if (swap_)
        step_swap();
      else
        end_leftover_swaps();
      if (is_settled())
        for (const auto& command : std::exchange(postponed_, {})) obey(command);
      if (!changed.empty() || Clock::now() - published_ >= kStatusPeriod) publish_status();
    } while (!down_ && Clock::now() < until);
  }

  bool is_down() const { return down_; }
  std::string failure() const { return failure_; }
  std::size_t adopted() const { return adopted_; }
  void leave() { left_ = true; }

 private:
  SupervisorOptions supervisor_options() const {
    return {.folder = folder_.path(),
            .executables = options_.executables,
            .graph_folder = std::filesystem::absolute(graph_.file).parent_path(),
            .allow_exec = options_.allow_exec,
            .detached = options_.detached,
            .leaves = leaves_of(graph_, catalog_)};
  }

  // The run goes on as it was, with what has been swapped.
  void adopt_graph() {
    GraphDescription graph = parse(io::read_file(folder_.path() / "graph.yaml"), "graph");
    graph.file = graph_.file;
    graph_ = std::move(graph);
  }

  // Replicas of a stage that belong here.
  std::vector<std::uint32_t> own_replicas(const StageNode& node) const {
    std::vector<std::uint32_t> result;
    const auto hosts = hosts_of(node);
    for (std::uint32_t r = 0; r < hosts.size(); ++r)
      if (options_.host.empty() || hosts[r] == options_.host) result.push_back(r);
    return result;
  }

  bool is_running(const std::string& stage, std::uint32_t replica) const {
    return std::ranges::any_of(supervisor_.processes(), [&](const auto& process) {
      return process.stage == stage && process.replica == replica &&
             (process.state == ProcessState::running || process.state == ProcessState::restarting);
    });
  }

  // Of what belongs here, that of which nothing is known: it was neither stopped nor given up.
  void start_missing(const GraphView& view) {
    const auto processes = supervisor_.processes();
    const auto is_known = [&](const std::string& stage, std::uint32_t replica) {
      return std::ranges::any_of(processes, [&](const auto& process) {
        return process.stage == stage && process.replica == replica;
      });
    };
    for (const auto& node : graph_.stages) {
      if (in_the_middle(node.name, view)) continue;
      for (const std::uint32_t replica : own_replicas(node))
        if (!is_known(node.name, replica)) supervisor_.launch(graph_, node.name, replica);
    }
  }

  // -- topics ------------------------------------------------------------------------------------

  void open_topics() {
    const auto topic = [&](const char* what) { return control_topic(graph_, what); };
    status_writer_ = participant_.writer(topic("agent_status"), "AgentStatus", {.depth = 1});
    stage_writer_ = participant_.writer(topic("stage_status"), "StageStatus", {.depth = 16});
    command_writer_ = participant_.writer(topic("command"), "Command", {.depth = 16});
    reply_writer_ = participant_.writer(topic("reply"), "Reply", {.depth = 16});
    log_writer_ = participant_.writer(topic("log"), "LogLines", {.depth = 64});
    read<idl::Command>("command", {.depth = 16}, [this](const auto&, idl::Command command) {
      if (command.host == options_.host && known_ids_.insert(command.id).second)
        orders_.push_back(std::move(command));
    });
    // On one host hardly anything gets lost, and each status says all of the one before.
    const EndpointQos statuses =
        graph_.hosts.empty() ? kOverheard : EndpointQos{.depth = kStatusDepth};
    read<idl::StageStatus>("stage_status", statuses,
                           [this](const auto& header, idl::StageStatus status) {
                             const ProcessKey key{header.stage, status.replica, header.generation};
                             statuses_[key] = {header, std::move(status), Clock::now()};
                           });
    read<idl::AgentStatus>("agent_status", statuses, [this](const auto&, idl::AgentStatus status) {
      const std::string host = status.host;
      agents_[host] = {std::move(status), Clock::now()};
    });
    read<idl::FrameDone>("frame_done", {.depth = frame_history(graph_)},
                         [this](const auto& header, const idl::FrameDone& done) {
                           if (done.outcome == idl::Outcome::ended) return;
                           reports_.push_back({.leaf = header.stage,
                                               .epoch = header.epoch,
                                               .sequence = header.sequence,
                                               .failed = done.outcome == idl::Outcome::failed,
                                               .time = Clock::now()});
                           if (reports_.size() > kReportsKept) reports_.pop_front();
                         });
  }

  template <class Value, class Take>
  void read(const char* what, const EndpointQos& qos, Take take) {
    readers_.push_back(participant_.reader(control_topic(graph_, what), idl::type_name<Value>(),
                                           qos, [this, take](const Sample& sample) {
                                             try {
                                               const auto header = idl::decode_header(*sample);
                                               auto value = idl::decode<Value>(*sample);
                                               const std::scoped_lock lock(mutex_);
                                               take(header, std::move(value));
                                             } catch (const std::exception&) {
                                               return;  // a stranger's message
                                             }
                                             const std::uint64_t one = 1;
                                             if (::write(wake_, &one, sizeof one) < 0)
                                               return;  // it is full: awake already
                                           }));
  }

  idl::FrameHeader header() const {
    return {.graph = graph_.graph,
            .stage = "agent" + (options_.host.empty() ? "" : "/" + options_.host),
            .stamp = wall_nanoseconds()};
  }

  void publish_status() {
    idl::AgentStatus status{.host = options_.host,
                            .pid = static_cast<std::uint32_t>(::getpid()),
                            .processes = supervisor_.processes()};
    if (swap_) {
      status.swapping = swap_->request().stage;
      status.newcomer = swap_->request().new_generation;
    }
    const auto host = std::ranges::find(graph_.hosts, options_.host, &Host::name);
    if (host != graph_.hosts.end()) status.address = host->address;
    status_writer_->write(idl::encode(header(), status));
    published_ = Clock::now();
  }

  void say(const std::string& line) {
    if (options_.on_output && !line.empty()) options_.on_output("agent", line);
  }

  void print(const std::string& stage, std::uint32_t replica,
             const std::vector<std::string>& lines) {
    if (options_.on_output) {
      const StageNode* node = graph_.stage(stage);
      const std::string name = node == nullptr ? stage : process_name(*node, replica);
      for (const auto& line : lines) options_.on_output(name, line);
    }
    if (log_writer_ != nullptr)
      log_writer_->write(idl::encode(
          header(),
          idl::LogLines{
              .host = options_.host, .stage = stage, .replica = replica, .lines = lines}));
  }

  // Tells the graph about a process that cannot do so itself.
  void speak_for(const idl::AgentProcess& process) {
    if (process.state == ProcessState::running || process.candidate) return;
    const StageNode* node = graph_.stage(process.stage);
    if (node == nullptr) return;
    const bool restarting = process.state == ProcessState::restarting;
    const bool failed = process.state == ProcessState::failed;
    const std::string name = process_name(*node, process.replica);
    if (restarting) print(process.stage, process.replica, {process.text + ", starting it again"});
    if (failed) {
      print(process.stage, process.replica, {process.text + ", giving it up"});
      failure_ = "stage " + name + " " + process.text;
    }
    idl::FrameHeader header = this->header();
    header.stage = process.stage;
    header.generation = process.generation;
    stage_writer_->write(
        idl::encode(header, idl::StageStatus{.kind = node->use,
                                             .host = options_.host,
                                             .replica = process.replica,
                                             .state = restarting ? idl::State::restarting
                                                      : failed   ? idl::State::failed
                                                                 : idl::State::stopped,
                                             .activity = process.text}));
  }

  void reply(const idl::Command& command, ReplyState state, const std::string& text) {
    reply_writer_->write(idl::encode(header(), idl::Reply{command.id, options_.host, state, text}));
  }

  // -- orders ------------------------------------------------------------------------------------

  void obey_orders() {
    for (;;) {
      idl::Command command;
      {
        const std::scoped_lock lock(mutex_);
        if (orders_.empty()) return;
        command = std::move(orders_.front());
        orders_.pop_front();
      }
      obey(command);
    }
  }

  void obey(const idl::Command& command) {
    try {
      if (command.verb == verb::kLaunch) return launch(command);
      if (command.verb == verb::kReplace) return replace(command);
      if (command.verb == verb::kDismiss) return dismiss(command.stage, command.generation);
      if (command.verb == verb::kRetire || command.verb == verb::kKeep)
        return supervisor_.allow_restart(command.stage, command.generation,
                                         command.verb == verb::kKeep);
      if (command.verb == verb::kGraph) return take_graph(command);
      if (command.verb == verb::kSwap) return begin_swap(command);
      if (command.verb == verb::kClock)
        return reply(command, ReplyState::done, std::to_string(wall_nanoseconds()));
      if (command.verb == verb::kDown) {
        supervisor_.stop_all(source_);
        publish_status();
        down_ = true;
        reply(command, ReplyState::done, "");
        // The participant goes now, and what it has not delivered with it.
        for (const auto limit = Clock::now() + kFarewell;
             reply_writer_->matched() == 0 && Clock::now() < limit;)
          std::this_thread::sleep_for(10ms);
        reply_writer_->await_readers(kFarewell);
        return;
      }
      if (command.verb == verb::kStart || command.verb == verb::kStop ||
          command.verb == verb::kRestart)
        return change(command);
    } catch (const GraphError& error) {
      reply(command, ReplyState::refused, one_line(error));
    } catch (const std::exception& error) {
      reply(command, ReplyState::refused, error.what());
    }
  }

  // start, stop and restart of the stage's processes here.
  void change(const idl::Command& command) {
    const StageNode* node = graph_.stage(command.stage);
    if (node == nullptr) throw Error("there is no stage '" + command.stage + "'");
    const auto replicas = own_replicas(*node);
    if (replicas.empty()) throw Error("stage '" + command.stage + "' does not run here");
    if (swap_ && swap_->request().stage == command.stage)
      throw Error("busy: " + command.stage + " is being swapped");
    const auto any_running = [&] {
      return std::ranges::any_of(replicas, [&](auto r) { return is_running(node->name, r); });
    };
    if (command.verb != verb::kStart) {
      if (command.verb == verb::kStop && !any_running())
        return reply(command, ReplyState::done, "it was not running");
      supervisor_.stop(node->name);
      while (any_running())
        for (const auto& process : supervisor_.attend(10ms)) speak_for(process);
    }
    int started = 0;
    if (command.verb != verb::kStop)
      for (const std::uint32_t replica : replicas)
        if (!is_running(node->name, replica)) {
          supervisor_.launch(graph_, node->name, replica);
          ++started;
        }
    failure_.clear();
    publish_status();
    reply(command, ReplyState::done,
          command.verb == verb::kStart && started == 0 ? "it was running" : "");
  }

  void launch(const idl::Command& command) {
    // An agent that is new hears what its peers have ordered before; generations only grow.
    if (command.generation <= supervisor_.newest_generation(command.stage)) return;
    const GraphDescription graph = received(command.words.at(0));
    for (std::size_t i = 1; i < command.words.size(); ++i)
      supervisor_.launch(graph, command.stage,
                         static_cast<std::uint32_t>(std::stoul(command.words[i])),
                         command.generation, true);
    publish_status();
  }

  void replace(const idl::Command& command) {
    supervisor_.promote(command.stage, command.generation);
    std::set<std::uint32_t> before;
    for (const auto& process : supervisor_.processes())
      if (process.stage == command.stage && process.generation < command.generation)
        before.insert(process.generation);
    for (const std::uint32_t generation : before) dismiss(command.stage, generation);
    publish_status();
  }

  void dismiss(const std::string& stage, std::uint32_t generation) {
    supervisor_.stop(stage, generation);
    // Its end is seen here: nobody is to be told of it.
    const auto runs = [&] {
      return std::ranges::any_of(supervisor_.processes(), [&](const auto& process) {
        return process.stage == stage && process.generation == generation && process.pid != 0;
      });
    };
    while (runs())
      for (const auto& process : supervisor_.attend(10ms))
        if (process.stage != stage || process.generation != generation) speak_for(process);
    supervisor_.forget(stage, generation);
    publish_status();
  }

  void take_graph(const idl::Command& command) {
    graph_ = received(command.words.at(0));
    folder_.publish(graph_);
  }

  // A graph as an agent sends it: of the same run, but the files are those of this host.
  GraphDescription received(const std::string& text) const {
    GraphDescription graph = parse(text, "graph");
    graph.instance = graph_.instance;
    graph.file = graph_.file;
    graph.dds.security = graph_.dds.security;
    return graph;
  }

  // -- swap --------------------------------------------------------------------------------------

  // Words: "use=KIND", "exec=PATH", "host=NAME", "param=NAME=VALUE", "dry-run".
  GraphDescription changed_graph(const idl::Command& command, bool& dry_run) const {
    GraphDescription graph = graph_;
    StageNode* node = graph.stage(command.stage);
    if (node == nullptr) throw Error("there is no stage '" + command.stage + "'");
    const StageInfo info = info_of(*node, catalog_);
    if (info.has_frame_inputs() &&
        std::ranges::any_of(info.outputs, [](const PortInfo& port) { return port.latched; }))
      throw Error("stage '" + node->name +
                  "' learns from the whole stream: it is restarted with the stream, not swapped");
    for (const auto& word : command.words) {
      if (word == "dry-run") {
        dry_run = true;
        continue;
      }
      const auto [key, value] = split_setting(word);
      if (key == "use") {
        if (value != node->use) node->params.clear();
        node->use = value;
        node->exec.clear();
        node->outputs.clear();
      } else if (key == "exec") {
        node->outputs = info.outputs;
        node->exec = std::filesystem::absolute(value).string();
        node->use.clear();
      } else if (key == "host") {
        node->host = value;
      } else if (key == "param") {
        const auto [name, text] = split_setting(value);
        set_param(graph, node->name, name, {text});
      }
    }
    std::vector<Fault> faults = check(graph, catalog_);
    if (!faults.empty()) throw GraphError(std::move(faults));
    return graph;
  }

  // A new agent that has taken over processes hears of the others first, and of leftovers.
  bool is_settled() const {
    return adopted_ == 0 || Clock::now() - began_ > kLeftover + kSilentAfter;
  }

  // Whether something here is as it is only in the middle of a swap.
  bool in_the_middle(const std::string& stage, const GraphView& view) const {
    std::set<std::uint32_t> running;
    for (const auto& process : supervisor_.processes()) {
      if (process.stage != stage || process.state != ProcessState::running) continue;
      if (process.candidate || !running.insert(process.replica).second) return true;
      const auto seen = view.statuses.find({stage, process.replica, process.generation});
      if (seen != view.statuses.end() &&
          (seen->second.second.candidate || seen->second.second.state == idl::State::drained))
        return true;
    }
    return supervisor_.any_retired(stage);
  }

  // Swaps whose leader was killed, or from whom this agent was cut off at the end.
  void end_leftover_swaps() {
    if (Clock::now() - looked_ < kStatusPeriod) return;
    looked_ = Clock::now();
    const GraphView view = this->view();
    const std::string lead = leads_swaps();
    std::string swapping;
    {
      const std::scoped_lock lock(mutex_);
      for (const auto& [host, agent] : agents_)
        if (host != options_.host && view.now - agent.heard > kSilentAfter &&
            view.now - agent.heard < kGoneAfter)
          return;
      if (const auto leader = agents_.find(lead); leader != agents_.end() && lead != options_.host)
        swapping = leader->second.status.swapping;
    }
    for (const auto& node : graph_.stages) {
      if (node.name == swapping || !in_the_middle(node.name, view)) {
        leftovers_.erase(node.name);
        continue;
      }
      const auto since = leftovers_.emplace(node.name, view.now).first->second;
      if (view.now - since < kLeftover) continue;
      leftovers_.erase(node.name);
      for (const auto& order : end_leftover_swap(view, node.name, options_.host)) {
        if (order.verb == verb::kReplace) announce_graph_of(order);
        send(order);
      }
      return;  // orders have changed the graph, and what is known is old
    }
    start_missing(view);
  }

  // The host of the source: its agent leads.
  std::string leads_swaps() const { return hosts_of(*graph_.stage(source_)).front(); }

  void announce_graph_of(const idl::Command& replaced) {
    for (const auto& process : supervisor_.processes())
      if (process.stage == replaced.stage && process.generation == replaced.generation)
        return announce(supervisor_.graph_of(replaced.stage, replaced.generation));
  }

  void begin_swap(const idl::Command& command) {
    if (!is_settled()) {  // this agent has just taken over: it knows more in a moment
      postponed_.push_back(command);
      return;
    }
    if (swap_) throw Error("busy: " + swap_->request().stage + " is being swapped");
    SwapRequest request{.stage = command.stage};
    request.graph = changed_graph(command, request.dry_run);
    request.old_hosts = hosts_of(*graph_.stage(command.stage));
    request.new_hosts = hosts_of(*request.graph.stage(command.stage));
    bool runs = false;
    const GraphView view = this->view();
    for (const auto& [key, process] : view.processes) {
      if (process.stage != command.stage) continue;
      request.new_generation = std::max(request.new_generation, process.generation + 1);
      if (process.candidate || process.pid == 0) continue;
      request.old_generation = std::max(request.old_generation, process.generation);
      runs = true;
    }
    if (!runs) throw Error("stage '" + command.stage + "' does not run: start it instead");
    for (const auto& host : request.new_hosts)
      if (!has_agent(host)) throw Error("no agent answers for host '" + host + "'");
    swap_.emplace(std::move(request), Clock::now());
    swap_command_ = command;
    swap_activity_.clear();
    reply(command, ReplyState::accepted, "");
  }

  bool has_agent(const std::string& host) const {
    const std::scoped_lock lock(mutex_);
    return options_.host.empty() || host == options_.host || agents_.contains(host);
  }

  GraphView view() {
    GraphView view{.now = Clock::now(), .source = source_};
    const std::scoped_lock lock(mutex_);
    std::erase_if(statuses_,
                  [&](const auto& entry) { return view.now - entry.second.heard > kForgetAfter; });
    for (const auto& [key, seen] : statuses_) view.statuses[key] = {seen.header, seen.status};
    const auto add = [&](const std::string& host, const std::vector<idl::AgentProcess>& processes) {
      for (const auto& process : processes) {
        const ProcessKey key{process.stage, process.replica, process.generation};
        view.processes[key] = process;
        view.hosts[key] = host;
      }
    };
    for (const auto& [host, agent] : agents_)
      if (host != options_.host) add(host, agent.status.processes);
    add(options_.host, supervisor_.processes());
    return view;
  }

  void step_swap() {
    const auto orders = swap_->step(view());
    const SwapRequest request = swap_->request();
    const bool changes_graph = swap_->succeeded() && !request.dry_run;
    if (changes_graph) announce(request.graph);  // first: where the stage belongs
    for (const auto& order : orders) send(order);
    if (swap_->activity() != swap_activity_) {
      swap_activity_ = swap_->activity();
      if (!swap_->finished()) reply(swap_command_, ReplyState::progress, swap_activity_);
    }
    if (!swap_->finished()) return;
    SwapReport report;
    {
      const std::scoped_lock lock(mutex_);
      report = swap_->report(reports_);
    }
    reply(swap_command_, report.done ? ReplyState::done : ReplyState::refused,
          report.done ? to_json(report, request) : report.text + "; the old one goes on");
    swap_.reset();
  }

  void announce(const GraphDescription& graph) {
    std::set<std::string> hosts{options_.host};
    {
      const std::scoped_lock lock(mutex_);
      for (const auto& [host, agent] : agents_) hosts.insert(host);
    }
    for (const auto& host : hosts)
      send({.id = random_id(),
            .host = host,
            .verb = std::string(verb::kGraph),
            .words = {to_yaml(graph)}});
  }

  // To a stage, to another agent, or to this one.
  void send(const idl::Command& command) {
    if (!verb::is_for_stage(command.verb) &&
        (options_.host.empty() || command.host == options_.host))
      obey(command);
    else
      command_writer_->write(idl::encode(header(), command));
  }

  struct Heard {
    idl::FrameHeader header;
    idl::StageStatus status;
    Clock::time_point heard;
  };

  AgentOptions options_;
  const Catalog& catalog_;
  RunFolder folder_;
  GraphDescription graph_;
  std::string source_;
  int wake_;
  mutable std::mutex mutex_;  // guards what readers write: up to reports_
  std::deque<idl::Command> orders_;
  std::set<std::uint64_t> known_ids_;
  std::map<ProcessKey, Heard> statuses_;
  struct HeardAgent {
    idl::AgentStatus status;
    Clock::time_point heard;
  };
  std::map<std::string, HeardAgent> agents_;
  std::deque<FrameReport> reports_;
  Supervisor supervisor_;
  std::size_t adopted_ = 0;
  const Clock::time_point began_ = Clock::now();
  Clock::time_point looked_{};                          // for leftovers
  std::map<std::string, Clock::time_point> leftovers_;  // stages, since when
  std::vector<idl::Command> postponed_;                 // swaps that are asked for too early
  std::string failure_;
  bool down_ = false;
  bool left_ = false;
  std::optional<Swap> swap_;
  idl::Command swap_command_;
  std::string swap_activity_;
  Clock::time_point published_{};

  std::unique_ptr<DiscoveryServer> discovery_server_;
  Participant participant_;
  std::unique_ptr<Writer> status_writer_;
  std::unique_ptr<Writer> stage_writer_;
  std::unique_ptr<Writer> command_writer_;
  std::unique_ptr<Writer> reply_writer_;
  std::unique_ptr<Writer> log_writer_;
  std::vector<std::unique_ptr<Reader>> readers_;
};

Agent::Agent(const GraphDescription& graph, const Catalog& catalog, AgentOptions options)
    : impl_(std::make_unique<Impl>(graph, catalog, std::move(options))) {}

Agent::~Agent() = default;

void Agent::step(std::chrono::milliseconds patience) {
  impl_->step(patience);
}

bool Agent::is_down() const {
  return impl_->is_down();
}

std::string Agent::failure() const {
  return impl_->failure();
}

std::size_t Agent::adopted() const {
  return impl_->adopted();
}

void Agent::leave() {
  impl_->leave();
}

}  // namespace cosegraph::graph
