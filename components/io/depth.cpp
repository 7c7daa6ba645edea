#include "io/depth.hpp"

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/fields.hpp"
#include "io/columns.hpp"
#include "io/file.hpp"

namespace cosegraph::io::depth {
namespace {

using Path = std::filesystem::path;

struct Intrinsics {
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  double depth_scale = 0.001;  // metres per step
};

Fields fields_of(Intrinsics& k) {
  constexpr double kFar = 1e9;
  constexpr double kTiny = 1e-9;
  return {number_field("fx", k.fx, kTiny, kFar, "px", "Focal length along a row."),
          number_field("fy", k.fy, kTiny, kFar, "px", "Focal length along a column."),
          number_field("cx", k.cx, -kFar, kFar, "px", "Column of the optical axis."),
          number_field("cy", k.cy, -kFar, kFar, "px", "Row of the optical axis."),
          number_field("depth_scale", k.depth_scale, kTiny, kFar, "m", "Depth of one step.")};
}

Intrinsics read_intrinsics(const Path& file) {
  Intrinsics result;
  const Fields fields = fields_of(result);
  const auto json = nlohmann::json::parse(read_file(file), nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) throw InputError(file.string() + ": is not a JSON object");
  for (const char* needed : {"fx", "fy", "cx", "cy"})
    if (!json.contains(needed))
      throw InputError(file.string() + ": lacks \"" + std::string(needed) + "\"");
  for (const auto& [key, value] : json.items()) {
    try {
      if (!value.is_number() && find(fields, key) != nullptr)
        throw ParameterError(key + ": expected a number");
      set_field(fields, key, {value.dump()});
    } catch (const ParameterError& error) {
      throw InputError(file.string() + ": " + error.what());
    }
  }
  return result;
}

std::uint32_t big_endian_word(std::string_view bytes) {
  std::uint32_t word = 0;
  for (int b = 0; b < 4; ++b) word = (word << 8) | static_cast<unsigned char>(bytes[b]);
  return word;
}

// Walks through the chunks of a PNG, so that a damaged or enormous one is refused before it is
// decoded.
void check_png(const Path& file, std::string_view png) {
  constexpr std::string_view kMagic("\x89PNG\r\n\x1a\n", 8);
  constexpr std::size_t kFrame = 12;  // length, type and checksum of a chunk
  if (!png.starts_with(kMagic) || png.size() < kMagic.size() + kFrame + 13)
    throw InputError(file.string() + ": is not a PNG file");
  const std::string_view header = png.substr(kMagic.size() + 8);
  check_point_count(file,
                    std::uint64_t{big_endian_word(header)} * big_endian_word(header.substr(4)));
  constexpr char kDepth16 = 16;
  constexpr char kGrey = 0;
  if (header[8] != kDepth16 || header[9] != kGrey)
    throw InputError(file.string() + ": is not a 16 bit grey image");
  png.remove_prefix(kMagic.size());
  while (png.size() >= kFrame) {
    const std::size_t length = big_endian_word(png);
    if (length > png.size() - kFrame) break;
    if (png.substr(4, 4) == "IEND") return;
    png.remove_prefix(kFrame + length);
  }
  throw InputError(file.string() + ": the image is truncated");
}

cv::Mat decode_png(const Path& file, const std::string& png) {
  check_png(file, png);
  cv::Mat image;
  try {
    const cv::Mat buffer(1, static_cast<int>(png.size()), CV_8UC1,
                         const_cast<char*>(png.data()));  // only read
    image = cv::imdecode(buffer, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception& error) {
    throw InputError(file.string() + ": the image cannot be decoded: " + error.err);
  }
  if (image.empty() || image.type() != CV_16UC1)
    throw InputError(file.string() + ": the image cannot be decoded");
  return image;
}

}  // namespace

Cloud decode(const Path& file, const std::string& png) {
  const cv::Mat image = decode_png(file, png);
  const Intrinsics k = read_intrinsics(Path(file).replace_extension(".json"));
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  Cloud cloud;
  cloud.width = static_cast<std::uint32_t>(image.cols);
  cloud.height = static_cast<std::uint32_t>(image.rows);
  cloud.xyz.reserve(3 * image.total());
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      const std::uint16_t steps = image.at<std::uint16_t>(row, column);
      const double z = steps * k.depth_scale;
      const std::array<float, 3> point{static_cast<float>((column - k.cx) / k.fx * z),
                                       static_cast<float>((row - k.cy) / k.fy * z),
                                       static_cast<float>(z)};
      for (const float value : point) cloud.xyz.push_back(steps == 0 ? kNan : value);
    }
  }
  return cloud;
}

}  // namespace cosegraph::io::depth
