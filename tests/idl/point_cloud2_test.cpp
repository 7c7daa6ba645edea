#include "idl/point_cloud2.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace cosegraph::idl {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Appends numbers in a chosen byte order, as a sensor's driver would.
class Data {
 public:
  explicit Data(bool big) : big_(big) {}
  template <class T>
  Data& operator<<(T value) {
    Bytes own(sizeof value);
    std::memcpy(own.data(), &value, sizeof value);
    if (big_) std::ranges::reverse(own);
    bytes_.insert(bytes_.end(), own.begin(), own.end());
    return *this;
  }
  Data& pad(std::size_t count) {
    bytes_.insert(bytes_.end(), count, 0xEE);
    return *this;
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  bool big_;
  Bytes bytes_;
};

PointCloud2 packed(std::vector<float> xyz) {
  Data data(false);
  for (const float x : xyz) data << x;
  const auto width = static_cast<std::uint32_t>(xyz.size() / 3);
  return {.width = width,
          .fields = {{"x", 0}, {"y", 4}, {"z", 8}},
          .point_step = 12,
          .row_step = 12 * width,
          .data = data.bytes()};
}

std::string refusal(const PointCloud2& message) {
  try {
    to_cloud(message);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(PointCloud2, PackedPointsBecomeACloud) {
  PointCloud2 message = packed({1, 2, 3, 4, 5, 6});
  message.frame_id = "camera";
  message.stamp = 12;
  const Cloud cloud = to_cloud(message);
  EXPECT_THAT(cloud.xyz, ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(cloud.normal, IsEmpty());
  EXPECT_THAT(cloud.rgb, IsEmpty());
  EXPECT_EQ(cloud.width, 2U);
  EXPECT_EQ(cloud.height, 1U);
  EXPECT_EQ(cloud.frame_id, "camera");
  EXPECT_EQ(cloud.stamp, 12);
}

// Any order, other columns in between, float64, padding behind points and rows, either byte order.
TEST(PointCloud2, AnyLayoutGivesTheSameCloud) {
  for (const bool big : {false, true}) {
    Data data(big);
    for (int row = 0; row < 2; ++row) {
      for (int i = 0; i < 2; ++i) {
        const int n = 2 * row + i;
        data << std::uint16_t{7};
        data << (n == 2 ? kNan : 1.0F * static_cast<float>(n));     // z at 2
        data << 10.0 + n << -0.5F * static_cast<float>(n);          // x at 6, y at 14
        data << std::uint32_t{0xFF3366CC} << 0.0F << 1.0F << 0.0F;  // rgba, normals
        data.pad(3);
      }
      data.pad(5);
    }
    const PointCloud2 message{.height = 2,
                              .width = 2,
                              .fields = {{"ring", 0, PointType::uint16},
                                         {"z", 2},
                                         {"x", 6, PointType::float64},
                                         {"y", 14},
                                         {"rgba", 18, PointType::uint32},
                                         {"normal_x", 22},
                                         {"normal_y", 26},
                                         {"normal_z", 30}},
                              .is_bigendian = big,
                              .point_step = 37,
                              .row_step = 79,
                              .data = data.bytes(),
                              .is_dense = false};
    const Cloud cloud = to_cloud(message);
    EXPECT_NO_THROW(check_sizes(cloud));
    EXPECT_EQ(cloud.width, 2U);
    EXPECT_EQ(cloud.height, 2U);
    ASSERT_THAT(cloud.xyz, SizeIs(12));
    for (std::size_t n = 0; n < 4; ++n) {
      EXPECT_EQ(cloud.xyz[3 * n], 10.0F + static_cast<float>(n));
      EXPECT_EQ(cloud.xyz[3 * n + 1], -0.5F * static_cast<float>(n));
      EXPECT_EQ(std::isnan(cloud.xyz[3 * n + 2]), n == 2);
      EXPECT_EQ(cloud.normal[3 * n + 1], 1.0F);
      EXPECT_FLOAT_EQ(cloud.rgb[3 * n], 0.2F);
      EXPECT_FLOAT_EQ(cloud.rgb[3 * n + 1], 0.4F);
      EXPECT_FLOAT_EQ(cloud.rgb[3 * n + 2], 0.8F);
    }
  }
}

TEST(PointCloud2, ACloudWithoutPointsIsOne) {
  PointCloud2 message = packed({});
  EXPECT_EQ(to_cloud(message).size(), 0U);
  message.height = std::numeric_limits<std::uint32_t>::max();
  EXPECT_EQ(to_cloud(message).size(), 0U);
}

TEST(PointCloud2, RefusalsNameTheField) {
  PointCloud2 message = packed({1, 2, 3});
  message.fields[1].name = "Y";
  EXPECT_EQ(refusal(message), "the points have no field 'y'");
  message = packed({1, 2, 3});
  message.fields[2].type = PointType::int16;
  EXPECT_EQ(refusal(message), "field 'z' is int16; it must be float32 or float64");
  message.fields[2].type = static_cast<PointType>(77);
  EXPECT_THAT(refusal(message), HasSubstr("field 'z' is an unknown type"));
  message = packed({1, 2, 3});
  message.fields[0].offset = 9;
  EXPECT_THAT(refusal(message), HasSubstr("field 'x' at offset 9 does not lie within the 12"));
  message.fields[0].offset = 0xFFFFFFFE;
  EXPECT_THAT(refusal(message), HasSubstr("field 'x'"));
  message = packed({1, 2, 3});
  message.fields.push_back({"rgb", 10});
  EXPECT_THAT(refusal(message), HasSubstr("field 'rgb'"));
}

TEST(PointCloud2, RefusesNumbersThatDoNotFitTheData) {
  PointCloud2 message = packed({1, 2, 3, 4, 5, 6});
  message.width = 3;
  EXPECT_THAT(refusal(message), HasSubstr("data has 24 bytes"));
  message.width = 1;
  message.height = 2;
  message.row_step = 11;
  EXPECT_THAT(refusal(message), HasSubstr("row_step is 11"));
  message = packed({1, 2, 3, 4, 5, 6});
  message.width = message.height = message.row_step = 0xFFFFFFFF;
  EXPECT_NE(refusal(message), "");
  message.point_step = 0;
  EXPECT_NE(refusal(message), "");
}

TEST(PointCloud2, EncodedAndDecodedItIsTheSame) {
  PointCloud2 message = packed({1, 2, 3, 4, 5, 6});
  message.frame_id = "odd";  // shifts what follows it
  message.fields[0].count = 3;
  message.is_bigendian = true;
  message.is_dense = false;
  for (const std::int64_t stamp :
       {std::int64_t{0}, std::int64_t{1'700'000'000'123'456'789}, std::int64_t{-1}}) {
    message.stamp = stamp;
    const PointCloud2 back = decode_point_cloud2(encode(message));
    EXPECT_EQ(back.stamp, stamp);
    EXPECT_EQ(back.frame_id, message.frame_id);
    EXPECT_EQ(back.width, message.width);
    EXPECT_EQ(back.height, message.height);
    ASSERT_THAT(back.fields, SizeIs(3));
    EXPECT_EQ(back.fields[2].name, "z");
    EXPECT_EQ(back.fields[2].offset, 8U);
    EXPECT_EQ(back.fields[2].type, PointType::float32);
    EXPECT_EQ(back.fields[0].count, 3U);
    EXPECT_TRUE(back.is_bigendian);
    EXPECT_EQ(back.point_step, message.point_step);
    EXPECT_EQ(back.row_step, message.row_step);
    EXPECT_EQ(back.data, message.data);
    EXPECT_FALSE(back.is_dense);
  }
}

// Written by hand from the rules of CDR, in both byte orders.
TEST(PointCloud2, DecodesBothEncapsulations) {
  for (const bool big : {false, true}) {
    Data data(big);
    data << std::int32_t{5} << std::uint32_t{6};                     // stamp
    data << std::uint32_t{4} << 'c' << 'a' << 'm' << '\0';           // frame_id
    data << std::uint32_t{1} << std::uint32_t{1};                    // height, width
    data << std::uint32_t{1};                                        // fields
    data << std::uint32_t{2} << 'x' << '\0';                         // name
    data.pad(2) << std::uint32_t{4} << std::uint8_t{8};              // offset, datatype
    data.pad(3) << std::uint32_t{1} << std::uint8_t{0};              // count, is_bigendian
    data.pad(3) << std::uint32_t{16} << std::uint32_t{16};           // point_step, row_step
    data << std::uint32_t{2} << std::uint8_t{9} << std::uint8_t{8};  // data
    data << std::uint8_t{1};                                         // is_dense
    Bytes bytes = {0, static_cast<std::uint8_t>(big ? 0 : 1), 0, 0};
    bytes.insert(bytes.end(), data.bytes().begin(), data.bytes().end());
    const PointCloud2 message = decode_point_cloud2(bytes);
    EXPECT_EQ(message.stamp, 5'000'000'006);
    EXPECT_EQ(message.frame_id, "cam");
    ASSERT_THAT(message.fields, SizeIs(1));
    EXPECT_EQ(message.fields[0].name, "x");
    EXPECT_EQ(message.fields[0].offset, 4U);
    EXPECT_EQ(message.fields[0].type, PointType::float64);
    EXPECT_EQ(message.row_step, 16U);
    EXPECT_THAT(message.data, ElementsAre(9, 8));
    EXPECT_TRUE(message.is_dense);
  }
}

// Cut short anywhere, or with any byte changed: an InputError at most.
TEST(PointCloud2, DamagedMessagesAreRefused) {
  const Bytes whole = encode(packed({1, 2, 3, 4, 5, 6}));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(decode_point_cloud2(std::span(whole).first(size)), InputError) << size;
  for (std::size_t at = 0; at < whole.size(); ++at)
    for (const int value : {0x00, 0x7F, 0xFF}) {
      Bytes bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(value);
      try {
        check_sizes(to_cloud(decode_point_cloud2(bytes)));
      } catch (const InputError&) {
        // As it should be.
      }
    }
}

TEST(PointCloud2, ALabelledCloudIsWhatRvizShows) {
  const Cloud cloud{.xyz = {1, 2, 3, kNan, kNan, kNan},
                    .rgb = {1.0F, 0.5F, 0.0F, 2.0F, -1.0F, kNan},
                    .label = {1, kNoLabel},
                    .label_names = {"body", "handle"},
                    .width = 1,
                    .height = 2,
                    .frame_id = "camera",
                    .stamp = 7};
  const std::vector<float> confidence = {0.75F, 0.0F};
  const PointCloud2 message = to_point_cloud2(cloud, confidence);
  EXPECT_EQ(message.frame_id, "camera");
  EXPECT_EQ(message.stamp, 7);
  EXPECT_EQ(message.width, 1U);
  EXPECT_EQ(message.height, 2U);
  EXPECT_FALSE(message.is_dense);
  std::vector<std::string> names;
  for (const auto& field : message.fields) names.push_back(field.name);
  EXPECT_THAT(names, ElementsAre("x", "y", "z", "rgb", "label", "confidence"));
  const auto at = [&](std::size_t point, std::size_t field, auto value) {
    std::memcpy(&value, &message.data[point * message.row_step + message.fields[field].offset],
                sizeof value);
    return value;
  };
  EXPECT_EQ(at(0, 2, 0.0F), 3.0F);
  EXPECT_EQ(at(0, 3, 0U), 0xFF8000U);
  EXPECT_EQ(at(1, 3, 0U), 0xFF0000U);
  EXPECT_EQ(at(0, 4, 0), 1);
  EXPECT_EQ(at(1, 4, 0), kNoLabel);
  EXPECT_EQ(at(0, 5, 0.0F), 0.75F);

  const Cloud back = to_cloud(decode_point_cloud2(encode(message)));
  EXPECT_EQ(back.xyz[2], 3.0F);
  EXPECT_TRUE(std::isnan(back.xyz[3]));
  EXPECT_EQ(back.height, 2U);
  EXPECT_EQ(back.frame_id, "camera");
}

TEST(PointCloud2, LabelsAndConfidencesMustBeThereForAll) {
  Cloud cloud{.xyz = {1, 2, 3}, .rgb = {1, 1, 1}, .label = {0}, .label_names = {"a"}, .width = 1};
  EXPECT_THROW(to_point_cloud2(cloud, {}), InputError);
  cloud.rgb.clear();
  EXPECT_THROW(to_point_cloud2(cloud, std::vector<float>{1.0F}), InputError);
}

}  // namespace
}  // namespace cosegraph::idl
