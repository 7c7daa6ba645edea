// The benchmarks behind `tools/bench`. Each prints a table: absolute times of this machine, and
// ratios against a peer measured in the same run, which are what to quote.
#pragma once

#include <sys/time.h>

#include <chrono>
#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "core/cloud.hpp"

namespace cosegraph::bench {

struct Subject {
  std::string name;
  std::vector<Cloud> reference;  // labelled views to train on
  std::vector<Cloud> queries;
};

// Two shapes of a kind: benchmark meshes where COSEGRAPH_DATA has them, else generated mugs.
Subject load_subject();

// Wall and CPU milliseconds of `work`.
struct Spent {
  double wall = 0.0;
  double cpu = 0.0;
};

template <class Work>
Spent measure(Work&& work) {
  const auto wall = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  work();
  return {.wall = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - wall)
                      .count(),
          .cpu = 1e3 * static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC};
}

double milliseconds(const timeval& time);

// The `cosegraph` of the same build.
std::string program();

// Of no values 0.
double quantile(std::vector<double> values, double share);
double median(std::vector<double> values);

int bench_frame(int repeats);        // a query frame and a training, stage by stage
int bench_overhead(int frames);      // what DDS and processes add to direct calls
int bench_security(int frames);      // what keys and encryption add to a graph
int bench_learning(int repeats);     // mixtures, Fisher vectors and classifiers against libraries
int bench_descriptors(int repeats);  // kernels of our own against PCL's
int bench_peers(int repeats);        // each stage against the stock PCL class
int bench_replicas(int frames);      // a slow stage as several processes
int bench_observers(int turns);      // what looking on costs a running graph
int bench_soak(int repeats);         // stages swapped and killed while frames flow

}  // namespace cosegraph::bench
