#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "core/error.hpp"
#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "io/scratch.hpp"

namespace cosegraph::io {
namespace {

using test::error_of;
using test::Scratch;
using testing::HasSubstr;

std::string png_of(const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

cv::Mat ramp() {
  cv::Mat image(3, 4, CV_16UC1);
  for (int i = 0; i < 12; ++i) image.at<std::uint16_t>(i / 4, i % 4) = i == 5 ? 0 : 1000 + 500 * i;
  return image;
}

constexpr const char* kIntrinsics = R"({"fx": 200, "fy": 100, "cx": 1.5, "cy": 1})";

TEST(DepthImage, PixelsAreThrownBackThroughThePinhole) {
  const Scratch scratch;
  scratch.file("d.json", R"({"fx": 200, "fy": 100, "cx": 1.5, "cy": 1, "depth_scale": 0.0002})");
  const Cloud cloud = read_cloud(scratch.file("d.png", png_of(ramp())));
  EXPECT_EQ(cloud.width, 4U);
  EXPECT_EQ(cloud.height, 3U);
  check_sizes(cloud);
  for (int i = 0; i < 12; ++i) {
    const float* point = &cloud.xyz[3 * i];
    if (i == 5) {
      EXPECT_TRUE(std::isnan(point[0]) && std::isnan(point[1]) && std::isnan(point[2]));
      continue;
    }
    EXPECT_FLOAT_EQ(point[2], 0.0002F * static_cast<float>(1000 + 500 * i));
    EXPECT_NEAR(200.0F * point[0] / point[2] + 1.5F, i % 4, 1e-5);
    EXPECT_NEAR(100.0F * point[1] / point[2] + 1.0F, i / 4, 1e-5);
  }
}

TEST(DepthImage, AStepIsAMillimetreUnlessTold) {
  const Scratch scratch;
  scratch.file("d.json", kIntrinsics);
  EXPECT_FLOAT_EQ(read_cloud(scratch.file("d.png", png_of(ramp()))).xyz[2], 1.0F);
}

TEST(DepthImage, RefusesBadIntrinsics) {
  const Scratch scratch;
  const auto png = scratch.file("d.png", png_of(ramp()));
  const auto error = [&] { return error_of<InputError>([&] { read_cloud(png); }); };
  const auto error_with = [&](const char* json) {
    scratch.file("d.json", json);
    return error();
  };
  EXPECT_THAT(error(), HasSubstr("d.json"));
  EXPECT_EQ(error_with(kIntrinsics), "");
  EXPECT_THAT(error_with("{"), HasSubstr("not a JSON object"));
  EXPECT_THAT(error_with(R"({"fx": 200, "fy": 100, "cx": 1.5})"), HasSubstr("\"cy\""));
  EXPECT_THAT(error_with(R"({"fx": 0, "fy": 100, "cx": 1.5, "cy": 1})"), HasSubstr("fx"));
  EXPECT_THAT(error_with(R"({"fx": "2", "fy": 100, "cx": 1.5, "cy": 1})"), HasSubstr("a number"));
  EXPECT_THAT(error_with(R"({"fx": 2, "fy": 1, "cx": 1.5, "cy": 1, "depth_scal": 1})"),
              HasSubstr("depth_scale"));
}

TEST(DepthImage, RefusesOtherAndDamagedImages) {
  const Scratch scratch;
  scratch.file("d.json", kIntrinsics);
  const auto error_with = [&](const std::string& bytes) {
    const auto png = scratch.file("d.png", bytes);
    return error_of<InputError>([&] { read_cloud(png); });
  };
  EXPECT_THAT(error_with(png_of(cv::Mat(3, 4, CV_8UC1, cv::Scalar(1)))), HasSubstr("16 bit"));
  EXPECT_THAT(error_with(png_of(cv::Mat(3, 4, CV_16UC3, cv::Scalar(1)))), HasSubstr("16 bit"));
  EXPECT_THAT(error_with("no image"), HasSubstr("not a PNG"));
  const std::string whole = png_of(ramp());
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_THAT(error_with(whole.substr(0, length)), HasSubstr("d.png")) << length;
  std::string huge = whole;
  for (std::size_t i = 16; i < 24; ++i) huge[i] = '\x7f';
  EXPECT_THAT(error_with(huge), HasSubstr("points"));
}

}  // namespace
}  // namespace cosegraph::io
