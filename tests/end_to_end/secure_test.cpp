// The shipped graph with and without keys.
#include <gtest/gtest.h>

#include "end_to_end/world.hpp"

namespace cosegraph::test {
namespace {

// The shipped graph of queries with a line more in its head.
void write_graph(const std::string& file, const std::string& line) {
  std::string text = slurp(std::string(COSEGRAPH_SOURCE_DIR) + "/config/graphs/segment.yaml");
  text.insert(text.find("stages:"), line);
  io::write_file(file, text);
}

TEST(Security, LabelsAreTheSameByteForByte) {
  const World world;
  write_graph(world.path("plain.yaml"), "");
  write_graph(world.path("secure.yaml"), "dds: {security: keys}\n");
  World::expect_fine({"cosegraph", "keys", "init", world.path("secure.yaml")});
  const auto label = [&](const std::string& how, const std::string& graph, const std::string& out) {
    World::expect_fine({"cosegraph", how, world.path(graph), "--param",
                        "model.file=" + world.path("model.coseg"), "--param",
                        "source.path=" + world.path("queries"), "--param",
                        "sink.folder=" + world.path(out)});
  };
  label("run", "plain.yaml", "plain");
  label("run", "secure.yaml", "one_process");
  label("up", "secure.yaml", "processes");
  for (const char* name : {"/query-view0.ply", "/query-view1.ply"}) {
    const std::string plain = slurp(world.path("plain") + name);
    ASSERT_FALSE(plain.empty());
    EXPECT_EQ(plain, slurp(world.path("one_process") + name)) << name;
    EXPECT_EQ(plain, slurp(world.path("processes") + name)) << name;
  }
}

}  // namespace
}  // namespace cosegraph::test
