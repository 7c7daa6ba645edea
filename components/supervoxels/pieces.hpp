// Supervoxels that voxel adjacency leaves alone.
#pragma once

#include "core/values.hpp"

namespace cosegraph::supervoxels {

// Where a sensor sees a surface at a grazing angle its points are farther apart than the voxels,
// and single supervoxels lose touch with their surface. Every connected piece of fewer than three
// supervoxels becomes adjacent to the supervoxel of the point nearest to it, if that is within
// `reach`: a pair a < b is appended to `adjacency`.
void link_small_pieces(const Cloud& dense, float reach, Supervoxels& supervoxels);

}  // namespace cosegraph::supervoxels
