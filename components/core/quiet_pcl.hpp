// For the components that wrap PCL; the only header of core that needs it.
#pragma once

#include <pcl/console/print.h>

namespace cosegraph {

// PCL prints progress and warnings; its console is silenced once for the process.
inline void silence_pcl() {
  static const bool done = [] {
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
    return true;
  }();
  static_cast<void>(done);
}

}  // namespace cosegraph
