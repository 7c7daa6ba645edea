// A graph of two stages with keys in a folder of their own.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <thread>

#include "graph/security.hpp"
#include "graph_description/fake_catalog.hpp"
#include "io/file.hpp"
#include "tools/keys/key_folder.hpp"

namespace cosegraph::graph::test {

class KeyWorld {
 public:
  KeyWorld() {
    write_graph("{cloud: camera/dense}");
    issue_into("keys", keys::from_now(1));
    graph_.dds.security = (folder_ / "keys").string();
  }

  GraphDescription& graph() { return graph_; }
  std::filesystem::path path(std::string_view name) const { return folder_ / name; }

  // Keys of the same graph by other authorities.
  void issue_into(const std::string& folder, const Validity& validity) const {
    keys::init(graph_, fake_catalog(), folder_ / folder, validity);
  }

  GraphDescription with_keys_in(const std::string& folder) const {
    GraphDescription result = graph_;
    result.dds.security = (folder_ / folder).string();
    return result;
  }

  GraphDescription without_keys() const {
    GraphDescription result = graph_;
    result.dds.security.clear();
    return result;
  }

  // The graph file with these inputs of the stage `grow`; the description follows.
  void write_graph(const std::string& inputs) {
    const std::string text =
        "version: 1\ngraph: g\ndds: {domain: " + std::to_string(1 + ::getpid() % 230) +
        ", security: keys}\nstages:\n  camera: {use: source}\n  grow: {use: supervoxels, inputs: " +
        inputs + "}\n";
    io::write_file(folder_ / "graph.yaml", text);
    std::vector<Fault> faults;
    graph_ = parse(text, (folder_ / "graph.yaml").string(), faults);
    EXPECT_TRUE(faults.empty());
  }

 private:
  io::TemporaryFolder folder_;
  GraphDescription graph_;
};

// Waits for something that happens soon; the limit only keeps a broken test from hanging.
inline bool comes_true(const std::function<bool()>& condition) {
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > limit) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

}  // namespace cosegraph::graph::test
