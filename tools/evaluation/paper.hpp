// Table 1 and Fig. 4b of Araslanov, Koo, Gall, Behnke, GCPR 2016, for comparison.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>

namespace cosegraph::evaluation {

// The benchmark's categories in the order of the paper's columns, spelled as its folders.
constexpr std::array<std::string_view, 19> kPaperCategories{
    "Ant",     "Airplane", "Armadillo", "Bearing", "Bird", "Bust",  "Chair",
    "Cup",     "Fish",     "FourLeg",   "Glasses", "Hand", "Human", "Mech",
    "Octopus", "Plier",    "Table",     "Teddy",   "Vase"};

struct PaperRow {
  std::string_view configuration;   // as in pipeline::config_from_name; empty: not ours
  std::string_view title;           // as printed
  std::array<double, 19> accuracy;  // %
  double overall;                   // %, as printed
};

std::span<const PaperRow> paper_rows();  // all eleven, in its order

// Its accuracy in % in a category, where the paper has it.
std::optional<double> paper_accuracy(const PaperRow& row, std::string_view category);

// The paper's accuracy in % for a configuration in a category, where it has both.
std::optional<double> paper_accuracy(std::string_view configuration, std::string_view category);

// Fig. 4b: seconds per pair on the paper's laptop.
struct PaperTime {
  std::string_view title;
  double training;
  std::optional<double> presegmentation;
  double inference;
};

std::span<const PaperTime> paper_times();

}  // namespace cosegraph::evaluation
