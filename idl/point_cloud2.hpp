// sensor_msgs/PointCloud2 of ROS 2: between its bytes on the wire and clouds.
//
// A message describes its own points: named columns at offsets, points `point_step` and rows
// `row_step` bytes apart, numbers in either byte order. Reading takes any such layout; a message
// that contradicts itself becomes an InputError that names the field.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/cloud.hpp"
#include "idl/codec.hpp"

namespace cosegraph::idl {

constexpr std::string_view kPointCloud2 = "sensor_msgs::msg::dds_::PointCloud2_";

// Of one number of a column, numbered as on the wire.
enum class PointType : std::uint8_t {
  int8 = 1,
  uint8,
  int16,
  uint16,
  int32,
  uint32,
  float32,
  float64
};

struct PointField {
  std::string name;
  std::uint32_t offset = 0;
  PointType type = PointType::float32;
  std::uint32_t count = 1;
};

struct PointCloud2 {
  std::int64_t stamp = 0;  // ns since 1970
  std::string frame_id;
  std::uint32_t height = 1;
  std::uint32_t width = 0;
  std::vector<PointField> fields;
  bool is_bigendian = false;
  std::uint32_t point_step = 0;
  std::uint32_t row_step = 0;
  Bytes data;
  bool is_dense = true;
};

// In this machine's byte order.
Bytes encode(const PointCloud2& message);
// In either. Throws InputError if the bytes do not hold such a message.
PointCloud2 decode_point_cloud2(std::span<const std::uint8_t> bytes);

// Points in their order, NaN ones too; rows stay. Columns that are used: x, y, z (float32 or
// float64), normal_x, normal_y, normal_z (likewise, if all three are there), rgb or rgba (4 bytes,
// red in bits 16 to 23). Throws InputError naming the field that is missing, of another type or
// outside of its point, or the numbers that do not fit the data.
Cloud to_cloud(const PointCloud2& message);

// Columns x, y, z, rgb (float32, as PCL and rviz have it), label (int32, an index into
// cloud.label_names or kNoLabel) and confidence (float32). Throws InputError unless there are a
// colour, a label and a confidence for every point.
PointCloud2 to_point_cloud2(const Cloud& cloud, std::span<const float> confidence);

}  // namespace cosegraph::idl
