#include "tools/monitor/point_cloud.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "sink/sink.hpp"

namespace cosegraph::monitor {

const std::string_view kPointCloudSchema = R"idl(module foxglove {
struct Time { uint32 sec; uint32 nsec; };
struct Vector3 { double x; double y; double z; };
struct Quaternion { double x; double y; double z; double w; };
struct Pose { Vector3 position; Quaternion orientation; };
enum NumericType { UNKNOWN, UINT8, INT8, UINT16, INT16, UINT32, INT32, FLOAT32, FLOAT64 };
struct PackedElementField { string name; uint32 offset; NumericType type; };
struct PointCloud {
  Time timestamp;
  string frame_id;
  Pose pose;
  uint32 point_stride;
  sequence<PackedElementField> fields;
  sequence<uint8> data;
};
};
)idl";

namespace {

static_assert(std::endian::native == std::endian::little, "written as the machine's own bytes");

// CDR (XCDR1), little endian.
class Writer {
 public:
  Writer() : bytes_{0, 1, 0, 0} {}

  template <class Number>
  void number(Number value) {
    while ((bytes_.size() - 4) % sizeof value != 0) bytes_.push_back(0);
    raw(&value, sizeof value);
  }
  void count(std::size_t value) { number(static_cast<std::uint32_t>(value)); }
  void text(std::string_view value) {
    count(value.size() + 1);
    raw(value.data(), value.size());
    bytes_.push_back(0);
  }
  // Room for so many bytes, to be filled.
  std::uint8_t* room(std::size_t size) {
    bytes_.resize(bytes_.size() + size);
    return bytes_.data() + (bytes_.size() - size);
  }
  idl::Bytes take() { return std::move(bytes_); }

 private:
  void raw(const void* data, std::size_t size) { std::memcpy(room(size), data, size); }

  idl::Bytes bytes_;
};

enum NumericType : std::uint32_t { kUint8 = 1, kInt32 = 6, kFloat32 = 7 };

using Colour = std::array<std::uint8_t, 4>;

std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(value, 0.0F, 1.0F)));
}

Colour to_colour(const float* rgb) {
  return {to_byte(rgb[0]), to_byte(rgb[1]), to_byte(rgb[2]), 255};
}

Colour colour_of(const Cloud& cloud, std::span<const std::int32_t> id, std::size_t point) {
  if (!id.empty()) return to_colour(sink::palette(id[point]).data());
  if (!cloud.rgb.empty()) return to_colour(&cloud.rgb[3 * point]);
  return {200, 200, 200, 255};
}

}  // namespace

idl::Bytes encode_point_cloud(const Cloud& cloud, std::span<const std::int32_t> id,
                              std::string_view id_name, std::int64_t stamp) {
  if (!id.empty() && id.size() != cloud.size())
    throw InputError("there are " + std::to_string(id.size()) + " numbers for " +
                     std::to_string(cloud.size()) + " points");
  constexpr std::int64_t kSecond = 1'000'000'000;
  Writer writer;
  writer.number(static_cast<std::uint32_t>(stamp / kSecond));
  writer.number(static_cast<std::uint32_t>(stamp % kSecond));
  writer.text("cosegraph");
  for (const double value : {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}) writer.number(value);
  const std::size_t stride = id.empty() ? 16 : 20;
  writer.count(stride);
  writer.count(id.empty() ? 7 : 8);
  std::uint32_t offset = 0;
  const auto field = [&](std::string_view name, NumericType type, std::uint32_t size) {
    writer.text(name);
    writer.number(offset);
    writer.number(static_cast<std::uint32_t>(type));
    offset += size;
  };
  for (const auto name : {"x", "y", "z"}) field(name, kFloat32, 4);
  for (const auto name : {"red", "green", "blue", "alpha"}) field(name, kUint8, 1);
  if (!id.empty()) field(id_name, kInt32, 4);
  writer.count(stride * cloud.size());
  std::uint8_t* out = writer.room(stride * cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i, out += stride) {
    const Colour colour = colour_of(cloud, id, i);
    std::memcpy(out, &cloud.xyz[3 * i], 12);
    std::memcpy(out + 12, colour.data(), 4);
    if (!id.empty()) std::memcpy(out + 16, &id[i], 4);
  }
  return writer.take();
}

}  // namespace cosegraph::monitor
