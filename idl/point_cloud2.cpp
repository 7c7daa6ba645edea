#include "idl/point_cloud2.hpp"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastcdr/exceptions/Exception.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

#include "idl/layout.hpp"
#include "ros2_point_cloud2.h"

namespace cosegraph::idl {
namespace {

using Message = sensor_msgs::msg::dds_::PointCloud2_;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

constexpr std::string_view kLayout = "44s44[s414]144b1";
constexpr std::int64_t kNanoseconds = 1'000'000'000;
constexpr bool kIsBigEndian = std::endian::native == std::endian::big;

std::string_view type_text(PointType type) {
  constexpr std::array<std::string_view, 8> kNames = {"int8",  "uint8",  "int16",   "uint16",
                                                      "int32", "uint32", "float32", "float64"};
  const auto at = static_cast<std::size_t>(type) - 1;
  return at < kNames.size() ? kNames[at] : "an unknown type";
}

bool is_float(PointType type) {
  return type == PointType::float32 || type == PointType::float64;
}

std::size_t size_of(PointType type) {
  switch (type) {
    case PointType::int8:
    case PointType::uint8:
      return 1;
    case PointType::int16:
    case PointType::uint16:
      return 2;
    case PointType::float64:
      return 8;
    default:
      return 4;
  }
}

// Rows lie within the data, and do not overlap.
void check_layout(const PointCloud2& message) {
  const std::uint64_t row = std::uint64_t{message.width} * message.point_step;
  if (message.height == 0 || row == 0) return;
  if (message.height > 1 && row > message.row_step)
    throw InputError("row_step is " + std::to_string(message.row_step) + ", but " +
                     std::to_string(message.width) + " points of " +
                     std::to_string(message.point_step) + " bytes take more");
  const std::uint64_t all = std::uint64_t{message.height - 1} * message.row_step + row;
  if (all > message.data.size())
    throw InputError("data has " + std::to_string(message.data.size()) + " bytes, but " +
                     std::to_string(message.width) + " x " + std::to_string(message.height) +
                     " points take " + std::to_string(all));
}

const PointField* find(const PointCloud2& message, std::string_view name) {
  const auto found = std::ranges::find(message.fields, name, &PointField::name);
  return found == message.fields.end() ? nullptr : &*found;
}

void check_inside(const PointCloud2& message, const PointField& field) {
  if (field.offset + std::uint64_t{size_of(field.type)} > message.point_step)
    throw InputError("field '" + field.name + "' at offset " + std::to_string(field.offset) +
                     " does not lie within the " + std::to_string(message.point_step) +
                     " bytes of a point");
}

// The number of type T at `bytes`, in this machine's byte order after `swap`.
template <class T>
T load(const std::uint8_t* bytes, bool swap) {
  std::array<std::uint8_t, sizeof(T)> own;
  std::copy_n(bytes, own.size(), own.begin());
  if (swap) std::ranges::reverse(own);
  return std::bit_cast<T>(own);
}

// One number per point of a message whose layout has been checked.
class Column {
 public:
  Column(const PointCloud2& message, const PointField& field)
      : offset_(field.offset),
        is_double_(field.type == PointType::float64),
        swap_(message.is_bigendian != kIsBigEndian) {
    check_inside(message, field);
  }

  float number(const std::uint8_t* point) const {
    return is_double_ ? static_cast<float>(load<double>(point + offset_, swap_))
                      : load<float>(point + offset_, swap_);
  }
  std::uint32_t word(const std::uint8_t* point) const {
    return load<std::uint32_t>(point + offset_, swap_);
  }

 private:
  std::size_t offset_;
  bool is_double_;
  bool swap_;
};

Column coordinate(const PointCloud2& message, std::string_view name) {
  const PointField* field = find(message, name);
  if (field == nullptr) throw InputError("the points have no field '" + std::string(name) + "'");
  if (!is_float(field->type))
    throw InputError("field '" + field->name + "' is " + std::string(type_text(field->type)) +
                     "; it must be float32 or float64");
  return {message, *field};
}

// The normals' three columns, or none.
std::vector<Column> normal_columns(const PointCloud2& message) {
  std::vector<Column> columns;
  for (const std::string_view name : {"normal_x", "normal_y", "normal_z"}) {
    const PointField* field = find(message, name);
    if (field == nullptr || !is_float(field->type)) return {};
    columns.emplace_back(message, *field);
  }
  return columns;
}

std::optional<Column> colour_column(const PointCloud2& message) {
  const PointField* field = find(message, "rgb");
  if (field == nullptr) field = find(message, "rgba");
  if (field == nullptr || size_of(field->type) != sizeof(std::uint32_t)) return std::nullopt;
  return Column(message, *field);
}

// Bits 16 to 23 red, then green and blue.
std::uint32_t packed(const float* rgb) {
  std::uint32_t word = 0;
  for (int c = 0; c < 3; ++c) {
    const float inside = rgb[c] > 0.0F ? std::min(rgb[c], 1.0F) : 0.0F;  // NaN: 0
    word = word << 8U | static_cast<std::uint32_t>(std::lround(255.0F * inside));
  }
  return word;
}

template <class T>
void append(Bytes& bytes, T value) {
  const auto own = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
  bytes.insert(bytes.end(), own.begin(), own.end());
}

Message to_message(const PointCloud2& value) {
  Message message;
  // Seconds are rounded down, so that nanoseconds are positive.
  const std::int64_t nanoseconds = (value.stamp % kNanoseconds + kNanoseconds) % kNanoseconds;
  auto& stamp = message.header().stamp();
  stamp.sec(static_cast<std::int32_t>((value.stamp - nanoseconds) / kNanoseconds));
  stamp.nanosec(static_cast<std::uint32_t>(nanoseconds));
  message.header().frame_id(value.frame_id);
  message.height(value.height);
  message.width(value.width);
  for (const auto& field : value.fields) {
    sensor_msgs::msg::dds_::PointField_ column;
    column.name(field.name);
    column.offset(field.offset);
    column.datatype(static_cast<std::uint8_t>(field.type));
    column.count(field.count);
    message.fields().push_back(std::move(column));
  }
  message.is_bigendian(value.is_bigendian);
  message.point_step(value.point_step);
  message.row_step(value.row_step);
  message.data(value.data);
  message.is_dense(value.is_dense);
  return message;
}

PointCloud2 to_value(Message& message) {
  const auto& stamp = message.header().stamp();
  PointCloud2 value{.stamp = stamp.sec() * kNanoseconds + stamp.nanosec(),
                    .frame_id = std::move(message.header().frame_id()),
                    .height = message.height(),
                    .width = message.width(),
                    .is_bigendian = message.is_bigendian(),
                    .point_step = message.point_step(),
                    .row_step = message.row_step(),
                    .data = std::move(message.data()),
                    .is_dense = message.is_dense()};
  for (auto& field : message.fields())
    value.fields.push_back({.name = std::move(field.name()),
                            .offset = field.offset(),
                            .type = static_cast<PointType>(field.datatype()),
                            .count = field.count()});
  return value;
}

}  // namespace

Bytes encode(const PointCloud2& value) {
  const Message message = to_message(value);
  FastBuffer buffer;
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  message.serialize(cdr);
  const auto* data = reinterpret_cast<const std::uint8_t*>(cdr.getBufferPointer());
  return {data, data + cdr.getSerializedDataLength()};
}

PointCloud2 decode_point_cloud2(std::span<const std::uint8_t> bytes) {
  if (!fits_layout(bytes, kLayout))
    throw InputError("PointCloud2 message is truncated or claims an impossible length");
  // FastBuffer wants a mutable pointer; reading does not change it.
  auto* data = const_cast<char*>(reinterpret_cast<const char*>(bytes.data()));
  FastBuffer buffer(data, bytes.size());
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  try {
    Message message;
    cdr.read_encapsulation();
    message.deserialize(cdr);
    return to_value(message);
  } catch (const eprosima::fastcdr::exception::Exception& error) {
    throw InputError(std::string("PointCloud2 message cannot be read: ") + error.what());
  }
}

Cloud to_cloud(const PointCloud2& message) {
  const std::array<Column, 3> xyz = {coordinate(message, "x"), coordinate(message, "y"),
                                     coordinate(message, "z")};
  const auto normal = normal_columns(message);
  const auto colour = colour_column(message);
  check_layout(message);
  Cloud cloud{.width = message.width,
              .height = message.height,
              .frame_id = message.frame_id,
              .stamp = message.stamp};
  const std::size_t size = std::size_t{message.width} * message.height;
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint8_t* point = message.data.data() + i / message.width * message.row_step +
                                i % message.width * message.point_step;
    for (const auto& column : xyz) cloud.xyz.push_back(column.number(point));
    for (const auto& column : normal) cloud.normal.push_back(column.number(point));
    if (!colour) continue;
    const std::uint32_t word = colour->word(point);
    for (const unsigned shift : {16U, 8U, 0U})
      cloud.rgb.push_back(static_cast<float>(word >> shift & 0xFFU) / 255.0F);
  }
  return cloud;
}

PointCloud2 to_point_cloud2(const Cloud& cloud, std::span<const float> confidence) {
  const std::size_t size = cloud.size();
  if (cloud.rgb.size() != 3 * size || cloud.label.size() != size || confidence.size() != size)
    throw InputError("a colour, a label and a confidence are needed for every point");
  constexpr std::uint32_t kStep = 24;
  PointCloud2 message{.stamp = cloud.stamp,
                      .frame_id = cloud.frame_id,
                      .height = cloud.height,
                      .width = cloud.width,
                      .fields = {{"x", 0, PointType::float32},
                                 {"y", 4, PointType::float32},
                                 {"z", 8, PointType::float32},
                                 {"rgb", 12, PointType::float32},
                                 {"label", 16, PointType::int32},
                                 {"confidence", 20, PointType::float32}},
                      .is_bigendian = kIsBigEndian,
                      .point_step = kStep,
                      .row_step = kStep * cloud.width};
  message.data.reserve(kStep * size);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) append(message.data, cloud.xyz[3 * i + axis]);
    append(message.data, packed(&cloud.rgb[3 * i]));
    append(message.data, cloud.label[i]);
    append(message.data, confidence[i]);
  }
  message.is_dense = std::ranges::all_of(cloud.xyz, [](float x) { return std::isfinite(x); });
  return message;
}

}  // namespace cosegraph::idl
