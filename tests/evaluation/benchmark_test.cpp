#include "tools/evaluation/benchmark.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.hpp"
#include "evaluation/world.hpp"

namespace cosegraph::evaluation {
namespace {

using test::TemporaryFolder;
using test::write_text;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::vector<std::string> names_of(const Category& category) {
  std::vector<std::string> names;
  for (const Shape& shape : category.shapes) names.push_back(shape.name);
  return names;
}

TEST(Benchmark, ShapesComeByNumberAndNamesBehindThem) {
  const TemporaryFolder folder;
  for (const std::string name : {"10", "9", "101", "mug", "cup"}) {
    write_text(folder.path() / "Cup" / (name + ".off"), "");
    write_text(folder.path() / "Cup" / (name + "_labels.txt"), "");
  }
  write_text(folder.path() / "Cup" / "readme.txt", "");
  std::vector<Problem> problems;
  EXPECT_THAT(names_of(read_category(folder.path(), "Cup", problems)),
              ElementsAre("9", "10", "101", "cup", "mug"));
  EXPECT_TRUE(problems.empty());
}

TEST(Benchmark, UnequalFilesAreNamedAndLeftOut) {
  const TemporaryFolder folder;
  const auto cup = folder.path() / "Cup";
  for (const std::string file : {"1.off", "1_labels.txt", "2.off", "3_labels.txt"})
    write_text(cup / file, "");
  std::vector<Problem> problems;
  EXPECT_THAT(names_of(read_category(folder.path(), "Cup", problems)), ElementsAre("1"));
  EXPECT_THAT(problems, ElementsAre(Problem{"Cup/2", "a mesh without the labels 2_labels.txt"},
                                    Problem{"Cup/3", "labels without the mesh 3.off"}));
}

TEST(Benchmark, AnEmptyCategoryIsAProblemAndAnEmptyFolderAnError) {
  const TemporaryFolder folder;
  EXPECT_THAT(message_of([&] { category_names(folder.path()); }), HasSubstr("no category"));
  EXPECT_THAT(message_of([&] { category_names(folder.path() / "absent"); }),
              HasSubstr("cannot be read"));
  std::filesystem::create_directories(folder.path() / "Cup");
  std::filesystem::create_directories(folder.path() / ".git");
  EXPECT_THAT(category_names(folder.path()), ElementsAre("Cup"));
  std::vector<Problem> problems;
  EXPECT_TRUE(read_category(folder.path(), "Cup", problems).shapes.empty());
  EXPECT_THAT(problems, ElementsAre(Problem{"Cup", "no shapes in this folder"}));
}

TEST(Benchmark, CategoriesAreChosenInTheFoldersOrderAndUnknownOnesRefused) {
  const TemporaryFolder folder;
  for (const std::string name : {"Vase", "Ant", "Chair"})
    std::filesystem::create_directories(folder.path() / name);
  EXPECT_THAT(choose_categories(folder.path(), {}), ElementsAre("Ant", "Chair", "Vase"));
  EXPECT_THAT(choose_categories(folder.path(), {"Vase", "Ant"}), ElementsAre("Ant", "Vase"));
  EXPECT_THAT(message_of([&] { choose_categories(folder.path(), {"Chiar"}); }),
              testing::AllOf(HasSubstr("did you mean 'Chair'?"), HasSubstr("Ant, Chair, Vase")));
  EXPECT_THROW(choose_categories(folder.path(), {"Ant", "Ant"}), ParameterError);
}

}  // namespace
}  // namespace cosegraph::evaluation
