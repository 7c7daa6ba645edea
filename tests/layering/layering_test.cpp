// The sources keep the layers; and the checker finds each kind of breach in a tree that has it.
#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

#include "layering/layers.hpp"

namespace cosegraph::layering {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// A small source tree in a folder of its own, gone with the object.
class Tree {
 public:
  Tree() : folder_(std::filesystem::path(::testing::TempDir()) / unique_name()) {
    std::filesystem::create_directories(folder_);
  }
  ~Tree() { std::filesystem::remove_all(folder_); }
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;

  const std::filesystem::path& folder() const { return folder_; }

  void write(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories((folder_ / file).parent_path());
    std::ofstream(folder_ / file, std::ios::binary) << text;
  }

  std::vector<std::string> breaches_found() const {
    std::vector<std::string> result;
    for (const auto& breach : breaches(folder_)) result.push_back(to_text(breach));
    return result;
  }

 private:
  static std::string unique_name() {
    static int count = 0;
    return "cosegraph_layering_" + std::to_string(getpid()) + "_" + std::to_string(count++);
  }
  std::filesystem::path folder_;
};

// The breaches of a tree that holds this one file.
std::vector<std::string> found_in(const std::string& file, const std::string& text) {
  const Tree tree;
  tree.write(file, text);
  return tree.breaches_found();
}

TEST(Layers, AreKeptByTheSources) {
  std::string all;
  for (const auto& breach : breaches(COSEGRAPH_SOURCE_DIR)) all += to_text(breach) + "\n";
  EXPECT_EQ(all, "");
}

TEST(LayerChecker, PassesWhatIsAllowed) {
  const Tree tree;
  tree.write("components/astar/astar.hpp", "#include \"core/cloud.hpp\"\n");
  tree.write("components/astar/astar.cpp",
             "#include \"astar/astar.hpp\"\n#include \"spectra/spectra.hpp\"\n#include <vector>\n");
  tree.write("components/cpc/cpc.cpp", "#include <pcl/point_types.h>\n#include <Eigen/Core>\n");
  tree.write("components/io/file.cpp", "#include <fstream>\n#include <filesystem>\n");
  tree.write("components/sink/sink_stage.cpp",
             "#include \"graph/stage.hpp\"\n#include \"io/file.hpp\"\n#include <chrono>\n");
  tree.write("components/pipeline/pipeline.cpp", "#include \"training/training.hpp\"\n");
  tree.write("graph/dds.cpp", "#include <fastdds/dds/topic/TypeSupport.hpp>\n");
  tree.write("idl/codec.cpp", "#include <fastcdr/Cdr.h>\n#include \"coseg_cloud.h\"\n");
  tree.write("tests/fisher/fisher_test.cpp", "#include <vl/fisher.h>\n");
  tree.write("tests/graph_runtime/dds_test.cpp", "#include <fastdds/dds/log/Log.hpp>\n");
  tree.write("README.md", "#include <fastdds/anything.hpp> is not C++ here\n");
  EXPECT_THAT(tree.breaches_found(), IsEmpty());
}

TEST(LayerChecker, FindsThirdPartyHeadersInHeaders) {
  const std::string rule = ":1: PCL, OpenCV, VLFeat and Fast DDS stay in .cpp files";
  for (const std::string header : {"pcl/point_types.h", "opencv2/core.hpp", "vl/gmm.h"}) {
    EXPECT_THAT(found_in("components/cpc/cpc.hpp", "#include <" + header + ">\n"),
                ElementsAre("components/cpc/cpc.hpp" + rule));
  }
  EXPECT_THAT(found_in("graph/dds.hpp", "#include <fastdds/dds/log/Log.hpp>\n"),
              ElementsAre("graph/dds.hpp" + rule));
  EXPECT_THAT(found_in("idl/codec.hpp", "#include <fastcdr/Cdr.h>\n"),
              ElementsAre("idl/codec.hpp" + rule));
}

TEST(LayerChecker, FindsFastDdsOutsideTheGraph) {
  for (const std::string file : {"components/cpc/cpc.cpp", "components/cpc/cpc_stage.cpp",
                                 "idl/codec.cpp", "tools/main.cpp", "tests/cpc/cpc_test.cpp"}) {
    EXPECT_THAT(found_in(file, "\n#include <fastdds/dds/log/Log.hpp>\n"),
                ElementsAre(file + ":2: only graph/ includes Fast DDS"));
    EXPECT_THAT(found_in(file, "\n#include <fastrtps/utils/IPLocator.h>\n"),
                ElementsAre(file + ":2: only graph/ includes Fast DDS"));
  }
  EXPECT_THAT(found_in("tools/main.cpp", "#include <fastcdr/Cdr.h>\n"),
              ElementsAre("tools/main.cpp:1: only graph/ and idl/ include Fast CDR"));
}

TEST(LayerChecker, FindsGeneratedTypesOutsideIdl) {
  for (const std::string file : {"components/cpc/cpc_stage.cpp", "graph/dds.cpp", "tools/main.cpp"})
    for (const std::string header :
         {"coseg_cloud.h", "types/coseg_cloudPubSubTypes.h", "ros2_point_cloud2.h"})
      EXPECT_THAT(found_in(file, "#include \"" + header + "\"\n"),
                  ElementsAre(file + ":1: only idl/ sees generated types"));
}

TEST(LayerChecker, FindsAlgorithmsThatKnowTheRuntime) {
  for (const std::string file : {"components/cpc/cpc.cpp", "components/cpc/cpc.hpp"})
    for (const std::string header : {"graph/stage.hpp", "idl/codec.hpp"})
      EXPECT_THAT(found_in(file, "#include \"" + header + "\"\n"),
                  ElementsAre(file + ":1: an algorithm knows neither graph/ nor idl/"));
}

TEST(LayerChecker, FindsAlgorithmsThatKnowTheOutsideWorld) {
  for (const std::string header : {"fstream", "iostream", "filesystem", "chrono"})
    EXPECT_THAT(found_in("components/cpc/cpc.cpp", "#include <" + header + ">\n"),
                ElementsAre("components/cpc/cpc.cpp:1: an algorithm knows neither files nor"
                            " clocks: <" +
                            header + ">"));
  EXPECT_THAT(found_in("components/cpc/cpc.cpp", "#include <spdlog/spdlog.h>\n"),
              ElementsAre("components/cpc/cpc.cpp:1: an algorithm writes no logs and reads no"
                          " options"));
}

TEST(LayerChecker, FindsIncludedStages) {
  EXPECT_THAT(found_in("components/cpc/cpc_stage.cpp", "#include \"svm/svm_stage.hpp\"\n"),
              ElementsAre("components/cpc/cpc_stage.cpp:1: nobody includes a stage"));
  EXPECT_THAT(found_in("components/cpc/cpc_stage.cpp", "#include \"cpc/cpc_stage.cpp\"\n"),
              ElementsAre("components/cpc/cpc_stage.cpp:1: nobody includes a stage"));
}

TEST(LayerChecker, FindsComponentsThatIncludeOthers) {
  const auto expect_found = [](const std::string& file, const std::string& from,
                               const std::string& to) {
    EXPECT_THAT(found_in(file, "#include \"" + to + "/" + to + ".hpp\"\n"),
                ElementsAre(file + ":1: '" + from + "' does not include '" + to + "'"));
  };
  expect_found("components/core/cloud.cpp", "core", "io");
  expect_found("components/cpc/cpc.cpp", "cpc", "supervoxels");
  expect_found("components/cpc/cpc_stage.cpp", "cpc", "supervoxels");
  expect_found("components/spectra/spectra.cpp", "spectra", "astar");
  expect_found("components/svm/svm.cpp", "svm", "training");
  expect_found("components/sink/sink.cpp", "sink", "io");
  expect_found("components/training/training.cpp", "training", "pipeline");
  EXPECT_THAT(found_in("graph/run.cpp", "#include \"cpc/cpc.hpp\"\n"),
              ElementsAre("graph/run.cpp:1: graph/ does not include 'cpc'"));
  EXPECT_THAT(found_in("idl/codec.cpp", "#include \"io/file.hpp\"\n"),
              ElementsAre("idl/codec.cpp:1: idl/ does not include 'io'"));
}

TEST(LayerChecker, FindsComponentsThatAreNotInTheTable) {
  EXPECT_THAT(found_in("components/newcomer/newcomer.cpp", "#include \"core/cloud.hpp\"\n"),
              ElementsAre("components/newcomer/newcomer.cpp:1: component 'newcomer' is not in the"
                          " table of layers"));
}

TEST(LayerChecker, FindsVlfeatInTheProduct) {
  EXPECT_THAT(found_in("components/fisher/fisher.cpp", "#include <vl/gmm.h>\n"),
              ElementsAre("components/fisher/fisher.cpp:1: VLFeat is an oracle for tests and"
                          " benchmarks only"));
}

TEST(LayerChecker, FindsTheBigHeaderOfOpenCv) {
  EXPECT_THAT(found_in("components/sink/picture.cpp", "#include <opencv2/opencv.hpp>\n"),
              ElementsAre("components/sink/picture.cpp:1: include the narrow headers of OpenCV"));
}

TEST(LayerChecker, FindsForbiddenFlagsAndDefinitions) {
  EXPECT_THAT(found_in("CMakeLists.txt", std::string("add_compile_options(-mar") + "ch=native)\n"),
              ElementsAre("CMakeLists.txt:1: no target has flags that change Eigen's alignment"));
  EXPECT_THAT(found_in("cmake/a.cmake", std::string("set(FLAGS -ffast-") + "math)\n"),
              ElementsAre("cmake/a.cmake:1: results must not depend on reordered arithmetic"));
  EXPECT_THAT(found_in("components/cpc/cpc.cpp", std::string("#define PCL_NO_") + "PRECOMPILE\n"),
              ElementsAre("components/cpc/cpc.cpp:1: PCL's own instantiations are used"));
}

TEST(LayerChecker, FindsPathsOfSomebodysMachine) {
  const std::string rule = "no path of somebody's machine";
  EXPECT_THAT(found_in("README.md", std::string("See /ho") + "me/me/clouds.\n"),
              ElementsAre("README.md:1: " + rule));
  const Tree tree;
  tree.write("tools/setup", "cd " + tree.folder().string() + "/tools\n");
  tree.write("config/a.yaml", "path: " + (tree.folder().parent_path() / "shared").string() + "\n");
  EXPECT_THAT(tree.breaches_found(),
              ElementsAre("config/a.yaml:1: " + rule, "tools/setup:1: " + rule));
}

TEST(LayerChecker, UnderstandsAllWaysToWriteAnInclude) {
  const std::string breach = "components/cpc/cpc.cpp:1: only graph/ includes Fast DDS";
  for (const std::string line :
       {"#include <fastdds/a.hpp>", "  #  include<fastdds/a.hpp>", "#include \"fastdds/a.hpp\"",
        "#include\t<fastdds/a.hpp>  // why", "#include <fastdds/a.hpp>\r"})
    EXPECT_THAT(found_in("components/cpc/cpc.cpp", line + "\n"), ElementsAre(breach)) << line;
  EXPECT_THAT(found_in("components/cpc/cpc.cpp", "// #include <fastdds/a.hpp>\n"), IsEmpty());
}

TEST(LayerChecker, LeavesOutBuildFoldersAndBinaries) {
  const Tree tree;
  const std::string breach = "#include <fastdds/a.hpp>\n";
  tree.write("build/components/cpc/cpc.cpp", breach);
  tree.write("build-asan/components/cpc/cpc.cpp", breach);
  tree.write(".git/components/cpc/cpc.cpp", breach);
  tree.write("components/cpc/picture.cpp", std::string(1, '\0') + "\n" + breach);
  EXPECT_THAT(tree.breaches_found(), IsEmpty());
}

TEST(LayerChecker, ReportsAllBreachesInOrder) {
  const Tree tree;
  tree.write("components/svm/svm.hpp", "#include <pcl/a.h>\n\n#include \"graph/stage.hpp\"\n");
  tree.write("components/cpc/cpc.cpp", "#include <chrono>\n#include \"svm/svm.hpp\"\n");
  EXPECT_THAT(tree.breaches_found(),
              ElementsAre("components/cpc/cpc.cpp:1: an algorithm knows neither files nor clocks:"
                          " <chrono>",
                          "components/cpc/cpc.cpp:2: 'cpc' does not include 'svm'",
                          "components/svm/svm.hpp:1: PCL, OpenCV, VLFeat and Fast DDS stay in .cpp"
                          " files",
                          "components/svm/svm.hpp:3: an algorithm knows neither graph/ nor idl/"));
}

}  // namespace
}  // namespace cosegraph::layering
