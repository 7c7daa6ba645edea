// Labelled triangle meshes as files: OFF or PLY, labels in the format of the Labelled Princeton
// Segmentation Benchmark. Errors and writing as in cloud_io.hpp.
#pragma once

#include <filesystem>

#include "core/cloud.hpp"

namespace cosegraph::io {

// Reads OFF (polygons are fanned into triangles; comments and "OFF" on the counts' line allowed)
// or PLY (faces with an optional `int label` property and "comment label K NAME" lines).
// Refuses a mesh without faces.
Mesh read_mesh(const std::filesystem::path& file);

// Adds labels in the benchmark's "N_labels.txt" format: a line with a label's name, then a line of
// 1-based face numbers, repeated. Throws InputError that names file, line and face if a face does
// not exist, has two labels or has none. Label indices follow the order of the file.
void read_labels(const std::filesystem::path& file, Mesh& mesh);

void write_off(const std::filesystem::path& file, const Mesh& mesh);
void write_labels(const std::filesystem::path& file, const Mesh& mesh);

// True for the extensions that read_mesh understands and that hold faces (a PLY is looked into).
bool is_mesh_file(const std::filesystem::path& file);

}  // namespace cosegraph::io
