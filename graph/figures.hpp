// Figures of this process that a stage reports, and latencies of its frames.
#pragma once

#include <cstdint>
#include <deque>
#include <string>

namespace cosegraph::graph {

std::int64_t wall_nanoseconds();  // since 1970
std::string machine_name();
double process_cpu_seconds();
std::uint64_t resident_bytes();

class Latencies {
 public:
  void add(double milliseconds);
  double sum() const { return sum_; }  // ms, of all
  double quantile(double q) const;     // ms, of the newest 512

 private:
  std::deque<double> newest_;
  double sum_ = 0.0;
};

}  // namespace cosegraph::graph
