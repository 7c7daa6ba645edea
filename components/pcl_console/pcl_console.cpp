#include "pcl_console/pcl_console.hpp"

#include <pcl/console/print.h>

namespace cosegraph {

void silence_pcl() {
  static const bool done = [] {
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
    return true;
  }();
  static_cast<void>(done);
}

}  // namespace cosegraph
