// A report as pictures: PNG bytes.
#pragma once

#include <string>

#include "tools/evaluation/evaluation.hpp"

namespace cosegraph::evaluation {

// The five criteria per configuration, as in the paper's Fig. 4a. The report must have pairs.
std::string metrics_png(const Report& report);

// Seconds per pair, on a logarithmic axis, beside the paper's (Fig. 4b).
std::string times_png(const Report& report);

// A confusion matrix per category, of one configuration.
std::string confusion_png(const Report& report, int configuration);

// The best, the median and the worst query of each category by one configuration: reference, true
// labels, given labels. Renders the views of those pairs again, so it needs the report's data.
std::string gallery_png(const Report& report, int configuration);

}  // namespace cosegraph::evaluation
