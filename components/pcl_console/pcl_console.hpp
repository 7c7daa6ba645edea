// PCL prints progress and warnings; an algorithm prints nothing.
#pragma once

namespace cosegraph {

// Turns PCL's console off for the rest of the process, as its level is one for the whole process.
// May be called by any thread, as often as one likes.
void silence_pcl();

}  // namespace cosegraph
