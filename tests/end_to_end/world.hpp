// A small world for the end-to-end tests: a trained mug, and views of another.
#pragma once

#include <filesystem>
#include <string>

#include "io/mesh_io.hpp"
#include "sample/shapes.hpp"
#include "support/program.hpp"

namespace cosegraph::test {

// Made anew by each test that needs it, as ctest runs every test in a process of its own.
class World {
 public:
  explicit World(const std::string& config = "fpfh+fv+iso") {
    write("reference", sample::make(sample::Kind::mug, 1));
    write("query", sample::make(sample::Kind::mug, 2));
    expect_fine({"cosegraph", "train", "--reference", path("reference.off"), "--config", config,
                 "--param", "source.camera.count=4", "-o", path("model.coseg")});
    expect_fine({"cosegraph", "view", path("query.off"), "--count", "2", "-o", path("queries")});
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  void write(const std::string& name, const Mesh& mesh) const {
    io::write_off(folder_ / (name + ".off"), mesh);
    io::write_labels(folder_ / (name + "_labels.txt"), mesh);
  }

  static void expect_fine(const std::vector<std::string>& words) {
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.status, 0) << outcome.errors << outcome.output;
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace cosegraph::test
