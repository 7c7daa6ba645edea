// Point clouds as files: PLY (ascii, binary little and big endian), PCD (all three encodings),
// depth PNG (16 bit) with intrinsics.
//
// Readers throw InputError that names the file and, where there is one, the line or field; they
// never return half a cloud. Writers go to a temporary name in the same folder and rename, so that
// a reader or a crash never sees half a file.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/cloud.hpp"

namespace cosegraph::io {

// Reads by extension (.ply .pcd .png; case ignored). Points keep the file's order; NaN points
// stay. `label` comes from an integer field "label", label names from PLY comments
// "label K NAME" (else the numbers as text). Organised PCD keeps width x height. A PLY that holds
// faces is read as a cloud of its vertices. Normals in the file are kept. A depth PNG needs
// "NAME.json" beside it (fx, fy, cx, cy in pixels, depth_scale in metres per step, default 0.001;
// 0 means no measurement) and becomes an organised cloud in the camera's frame.
// PCD "rgb"/"rgba" and PLY "red green blue" become rgb.
// Refuses: no points, more than kMaxPoints points.
Cloud read_cloud(const std::filesystem::path& file);

constexpr std::size_t kMaxPoints = 20'000'000;

// A further column of a PLY file's points, as write_cloud's `extra`; empty if the file has no such
// property, or is of another format. Throws InputError like read_cloud.
std::vector<float> read_column(const std::filesystem::path& file, std::string_view name);

// True for the extensions that read_cloud understands.
bool is_cloud_file(const std::filesystem::path& file);

// Extra per-point column of a written file.
struct Column {
  std::string name;
  std::span<const float> value;
};

enum class Encoding { binary, ascii };

// Writes x y z, normals and colours if present, `int label` with "comment label K NAME" lines if
// labelled, then `extra` as float columns. By extension: .ply or .pcd (PCD carries label names in
// leading "# label K NAME" comment lines, which read_cloud reads back).
void write_cloud(const std::filesystem::path& file, const Cloud& cloud,
                 std::span<const Column> extra = {}, Encoding encoding = Encoding::binary);

}  // namespace cosegraph::io
