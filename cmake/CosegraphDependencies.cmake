# Third-party libraries of the components; users of the installed package read this file too.
#
# PCL is not taken through its own CMake package: that
# pulls VTK, Qt and MPI into every target. The few libraries used are named here instead.
# The package is compiled as C++14, where PCL's classes bring an operator new of Eigen's. Since C++17
# Eigen leaves it out, and what PCL has allocated would be freed by another function than its own.

find_package(Threads REQUIRED)
find_package(OpenMP REQUIRED COMPONENTS CXX)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(OpenCV 4.6 REQUIRED COMPONENTS core imgproc imgcodecs)
find_package(nlohmann_json REQUIRED)

find_path(PCL_INCLUDE_DIR pcl/point_cloud.h PATH_SUFFIXES pcl-1.13 REQUIRED)
foreach(part common kdtree octree search features filters segmentation sample_consensus io
             io_ply)
  find_library(PCL_${part}_LIBRARY pcl_${part} REQUIRED)
  add_library(pcl::${part} UNKNOWN IMPORTED)
  set_target_properties(pcl::${part} PROPERTIES IMPORTED_LOCATION ${PCL_${part}_LIBRARY})
  set_target_properties(pcl::${part} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${PCL_INCLUDE_DIR}"
                        INTERFACE_SYSTEM_INCLUDE_DIRECTORIES "${PCL_INCLUDE_DIR}"
                        INTERFACE_COMPILE_DEFINITIONS EIGEN_HAS_CXX17_OVERALIGN=0
                        INTERFACE_LINK_LIBRARIES Eigen3::Eigen)
endforeach()

# Header-only or plain libraries without a CMake package.
find_path(NANOFLANN_INCLUDE_DIR nanoflann.hpp REQUIRED)
find_path(SPECTRA_INCLUDE_DIR Spectra/SymGEigsShiftSolver.h REQUIRED)
