# find_package(cosegraph): the algorithms, without DDS. Link cosegraph::pipeline, or single parts.
include(${CMAKE_CURRENT_LIST_DIR}/CosegraphDependencies.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/cosegraph.cmake)
