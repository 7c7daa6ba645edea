// Options of the command line that are a time.
#pragma once

#include <CLI/CLI.hpp>

namespace cosegraph::tools {

// The option's value, a double, is a number of seconds from `least` to `most`; people may write
// "2.5", "30s", "200ms", "5min" or "1h".
inline CLI::Option* takes_seconds(CLI::Option* option, double least, double most) {
  static const std::map<std::string, double> kUnits{
      {"ms", 1e-3}, {"s", 1.0}, {"min", 60.0}, {"h", 3600.0}};
  // Beforehand, so that the range is checked of the number of seconds.
  return option->transform(CLI::AsNumberWithUnit(kUnits))
      ->check(CLI::Range(least, most))
      ->option_text("SECONDS");
}

}  // namespace cosegraph::tools
