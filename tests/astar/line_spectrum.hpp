// A made-up spectrum whose commute-time distances are plain to see.
#pragma once

#include <vector>

#include "core/values.hpp"

namespace cosegraph::test {

// One eigenpair with eigenvalue 1: the distance of two samples is the difference of their
// positions. Sample s is point s of the dense cloud.
inline Spectrum line_spectrum(const std::vector<float>& position) {
  Spectrum spectrum;
  spectrum.recipe = "line";
  spectrum.eigenvalue = {1.0F};
  spectrum.eigenfunction = position;
  for (std::size_t s = 0; s < position.size(); ++s) {
    spectrum.sample.push_back(static_cast<std::int32_t>(s));
    spectrum.sample_dense.push_back(static_cast<std::int32_t>(s));
    spectrum.component.push_back(0);
  }
  spectrum.nearest_sample = spectrum.sample;
  return spectrum;
}

}  // namespace cosegraph::test
