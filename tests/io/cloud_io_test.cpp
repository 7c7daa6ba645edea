#include "io/cloud_io.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/random.hpp"
#include "io/file.hpp"
#include "io/scratch.hpp"
#include "support/data.hpp"

namespace cosegraph::io {
namespace {

using test::error_of;
using test::Scratch;
using testing::AllOf;
using testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// An organised 5 x 4 cloud with everything a file can hold; one point is missing.
Cloud full_cloud() {
  Random random(7);
  Cloud cloud;
  cloud.width = 5;
  cloud.height = 4;
  cloud.origin = {0.5F, -1.25F, 2.0F};
  cloud.label_names = {"body", "left handle", "spout"};
  for (int i = 0; i < 20; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      cloud.xyz.push_back(i == 3 ? kNan : static_cast<float>(random.normal()));
      cloud.normal.push_back(static_cast<float>(random.normal()));
      cloud.rgb.push_back(static_cast<float>(random.below(256)) / 255.0F);
    }
    cloud.label.push_back(static_cast<std::int32_t>(random.below(3)) - (i == 3 ? 3 : 0));
  }
  cloud.label[3] = kNoLabel;
  return cloud;
}

void expect_same(const std::vector<float>& a, const std::vector<float>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_TRUE(a[i] == b[i] || (std::isnan(a[i]) && std::isnan(b[i]))) << i;
}

void expect_same(const Cloud& a, const Cloud& b) {
  expect_same(a.xyz, b.xyz);
  expect_same(a.normal, b.normal);
  expect_same(a.rgb, b.rgb);
  EXPECT_EQ(a.label, b.label);
  EXPECT_EQ(a.label_names, b.label_names);
}

TEST(CloudIo, EveryFormatAndEncodingKeepsEveryBit) {
  const Scratch scratch;
  const Cloud cloud = full_cloud();
  for (const char* name : {"c.ply", "c.pcd", "C.PLY"}) {
    for (const Encoding encoding : {Encoding::binary, Encoding::ascii}) {
      SCOPED_TRACE(std::string(name) + (encoding == Encoding::binary ? " binary" : " ascii"));
      write_cloud(scratch / name, cloud, {}, encoding);
      const Cloud read = read_cloud(scratch / name);
      expect_same(cloud, read);
      check_sizes(read);
    }
  }
}

TEST(CloudIo, PcdKeepsTheGridAndTheSensorsPlace) {
  const Scratch scratch;
  write_cloud(scratch / "c.pcd", full_cloud());
  const Cloud read = read_cloud(scratch / "c.pcd");
  EXPECT_EQ(read.width, 5U);
  EXPECT_EQ(read.height, 4U);
  EXPECT_EQ(read.origin, full_cloud().origin);
}

TEST(CloudIo, BarePointsHaveNothingElse) {
  const Scratch scratch;
  Cloud cloud;
  cloud.xyz = {1, 2, 3, -4, 5e-20F, 6e20F};
  cloud.width = 2;
  for (const char* name : {"c.ply", "c.pcd"}) {
    write_cloud(scratch / name, cloud);
    const Cloud read = read_cloud(scratch / name);
    expect_same(cloud, read);
    EXPECT_EQ(read.size(), 2U);
    EXPECT_TRUE(read.normal.empty() && read.rgb.empty() && read.label.empty());
  }
}

TEST(CloudIo, ExtraColumnsOfPlyFilesAreReadBack) {
  const Scratch scratch;
  const Cloud cloud{.xyz = {0, 0, 1, 0, 1, 1}, .width = 2};
  const std::vector<float> confidence = {0.25F, 0.5F};
  const std::array columns{Column{"confidence", confidence}};
  for (const Encoding encoding : {Encoding::binary, Encoding::ascii}) {
    write_cloud(scratch / "c.ply", cloud, columns, encoding);
    EXPECT_EQ(read_column(scratch / "c.ply", "confidence"), confidence);
    EXPECT_TRUE(read_column(scratch / "c.ply", "doubt").empty());
  }
  write_cloud(scratch / "c.pcd", cloud, columns);
  EXPECT_TRUE(read_column(scratch / "c.pcd", "confidence").empty());
  EXPECT_THROW(read_column(scratch / "none.ply", "confidence"), InputError);
}

TEST(CloudIo, ExtraColumnsAreWritten) {
  const Scratch scratch;
  Cloud cloud;
  cloud.xyz = {1, 2, 3, 4, 5, 6};
  cloud.width = 2;
  const std::array confidence{0.25F, 0.5F};
  const std::array columns{Column{"confidence", confidence}};
  write_cloud(scratch / "c.ply", cloud, columns, Encoding::ascii);
  EXPECT_THAT(read_file(scratch / "c.ply"),
              AllOf(HasSubstr("property float confidence\n"), HasSubstr("\n4 5 6 0.5\n")));
}

TEST(CloudIo, RefusesToWriteWhatItCouldNotReadBack) {
  const Scratch scratch;
  Cloud cloud;
  cloud.xyz = {1, 2, 3};
  cloud.width = 1;
  const std::array values{0.0F, 1.0F};
  const auto error_with = [&](const char* name, std::size_t count) {
    const std::array columns{Column{name, std::span(values).first(count)}};
    return error_of<InputError>([&] { write_cloud(scratch / "c.ply", cloud, columns); });
  };
  EXPECT_THAT(error_with("fine", 2), HasSubstr("2 values for 1 points"));
  EXPECT_THAT(error_with("two words", 1), HasSubstr("no column name"));
  EXPECT_THAT(error_with("x", 1), HasSubstr("two columns"));
  cloud.label = {0};
  cloud.label_names = {"two\nlines"};
  EXPECT_THAT(error_of<InputError>([&] { write_cloud(scratch / "c.pcd", cloud); }),
              AllOf(HasSubstr("c.pcd"), HasSubstr("label name")));
  cloud.label_names = {};
  EXPECT_THAT(error_of<InputError>([&] { write_cloud(scratch / "c.pcd", cloud); }),
              HasSubstr("c.pcd"));
  EXPECT_NE(error_of<InputError>([&] { write_cloud(scratch / "c.xyz", {}); }), "");
  EXPECT_EQ(scratch.file_count(), 0U);
}

TEST(CloudIo, WritesTheSameBytesAgain) {
  const Scratch scratch;
  for (const char* name : {"c.ply", "c.pcd"}) {
    write_cloud(scratch / name, full_cloud());
    const std::string first = read_file(scratch / name);
    write_cloud(scratch / name, read_cloud(scratch / name));
    EXPECT_EQ(read_file(scratch / name), first);
  }
}

// ---- PLY from elsewhere

constexpr const char* kForeignPly =
    "ply\r\nformat ascii 1.0\r\ncomment label 7 lid\r\ncomment made elsewhere\r\n"
    "element camera 1\r\nproperty float focal\r\n"
    "element vertex 3\r\nproperty uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\n"
    "property list uchar short neighbours\r\nproperty double x\r\nproperty float64 y\r\n"
    "property float z\r\nproperty short label\r\n"
    "element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
    "35.5\r\n255 0 51 2 5 6 1 2 3 7\r\n0 0 0 0 +4 5e0 nan 4\r\n\r\n1 2 3 1 9 0 0 0 -1\r\n3 0 1 2";

TEST(Ply, ReadsListsOtherElementsAndLabelsInTheFilesOwnNumbers) {
  const Scratch scratch;
  const Cloud cloud = read_cloud(scratch.file("c.ply", kForeignPly));
  ASSERT_EQ(cloud.size(), 3U);
  EXPECT_EQ(cloud.xyz[3], 4.0F);
  EXPECT_TRUE(std::isnan(cloud.xyz[5]));
  EXPECT_FLOAT_EQ(cloud.rgb[2], 0.2F);
  EXPECT_EQ(cloud.label_names, (std::vector<std::string>{"4", "lid"}));
  EXPECT_EQ(cloud.label, (std::vector<std::int32_t>{1, 0, kNoLabel}));
  EXPECT_EQ(cloud.width, 3U);
}

template <class T>
void append(std::string& bytes, T value, std::endian order) {
  auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if (order != std::endian::native) std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

// Two vertices with one property of every type, and a list.
std::string every_type(std::endian order) {
  std::string bytes = "ply\nformat binary_";
  bytes += order == std::endian::little ? "little" : "big";
  bytes +=
      "_endian 1.0\nelement vertex 2\nproperty char a\nproperty uint8 b\nproperty int16 c\n"
      "property ushort d\nproperty list ushort double e\nproperty uint f\nproperty float x\n"
      "property double y\nproperty int z\nproperty int label\nend_header\n";
  for (int i = 0; i < 2; ++i) {
    append(bytes, std::int8_t{-1}, order);
    append(bytes, std::uint8_t{200}, order);
    append(bytes, std::int16_t{-300}, order);
    append(bytes, std::uint16_t{60000}, order);
    append(bytes, static_cast<std::uint16_t>(i), order);
    for (int k = 0; k < i; ++k) append(bytes, 1e300, order);
    append(bytes, std::uint32_t{4'000'000'000U}, order);
    append(bytes, 1.5F + static_cast<float>(i), order);
    append(bytes, -2.25, order);
    append(bytes, std::int32_t{-70000}, order);
    append(bytes, std::int32_t{i}, order);
  }
  return bytes;
}

TEST(Ply, BothByteOrdersAndAllTypesGiveTheSameCloud) {
  const Scratch scratch;
  for (const std::endian order : {std::endian::little, std::endian::big}) {
    const Cloud cloud = read_cloud(scratch.file("c.ply", every_type(order)));
    EXPECT_EQ(cloud.xyz, (std::vector<float>{1.5F, -2.25F, -70000.0F, 2.5F, -2.25F, -70000.0F}));
    EXPECT_EQ(cloud.label, (std::vector<std::int32_t>{0, 1}));
  }
}

// Every shorter file of the same kind is refused: the law of "never half a cloud".
void expect_every_prefix_refused(const Scratch& scratch, const std::string& name,
                                 const std::string& bytes) {
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const auto file = scratch.file(name, std::string_view(bytes).substr(0, length));
    EXPECT_THAT(error_of<InputError>([&] { read_cloud(file); }), HasSubstr(file.string()))
        << length << " bytes";
  }
}

TEST(Ply, ATruncatedBinaryFileIsRefusedAtEveryLength) {
  const Scratch scratch;
  expect_every_prefix_refused(scratch, "c.ply", every_type(std::endian::little));
}

TEST(Ply, FaultsAreNamedByLine) {
  const Scratch scratch;
  const auto error_in = [&](std::string header, std::string body) {
    const auto file = scratch.file("bad.ply", "ply\nformat ascii 1.0\n" + header +
                                                  "property float x\nproperty float y\n"
                                                  "property float z\nend_header\n" +
                                                  body);
    return error_of<InputError>([&] { read_cloud(file); });
  };
  const std::string two = "element vertex 2\n";
  EXPECT_EQ(error_in(two, "0 0 0\n1 1 1\n"), "");
  EXPECT_THAT(error_in(two, "0 0 0\n1.5 1\n"), HasSubstr("bad.ply:9: the line has too few"));
  EXPECT_THAT(error_in(two, "0 0 0 7\n1 1 1\n"), HasSubstr("bad.ply:8: the line has too many"));
  EXPECT_THAT(error_in(two, "0 0 0\n1 one 1\n"), HasSubstr("bad.ply:9: 'one' is not a number"));
  EXPECT_THAT(error_in(two, "0 0 0 \n     \n"), HasSubstr("ends at vertex 1 of 2"));
  EXPECT_THAT(error_in("element vertex 0\n", ""), HasSubstr("no points"));
  EXPECT_THAT(error_in("element vertex -2\n", ""), HasSubstr("bad.ply:3: expected 'element"));
  EXPECT_THAT(error_in("element points 1\n", "0 0 0\n"), HasSubstr("no element 'vertex'"));
  EXPECT_THAT(error_in("", ""), HasSubstr("bad.ply:3: a property before"));
  EXPECT_THAT(error_in(two + "property real w\n", ""), HasSubstr("bad.ply:4: 'real' is not a PLY"));
  EXPECT_THAT(error_in(two + "property int x\n", ""), HasSubstr("bad.ply:5: a second property"));
  EXPECT_THAT(error_in(two + "property float label\n", "0.5 0 0 0\n0 0 0 0\n"),
              HasSubstr("label of point 0"));
}

TEST(Ply, RefusesHugePromisesBeforeAllocating) {
  const Scratch scratch;
  const auto error_for = [&](const std::string& format, const std::string& count) {
    const auto file = scratch.file(
        "c.ply", "ply\nformat " + format + " 1.0\nelement vertex " + count +
                     "\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n");
    return error_of<InputError>([&] { read_cloud(file); });
  };
  for (const char* format : {"ascii", "binary_little_endian"}) {
    EXPECT_THAT(error_for(format, "4000000000"), HasSubstr("4000000000 points"));
    EXPECT_THAT(error_for(format, "19000000"), HasSubstr("the header promises 19000000"));
    EXPECT_THAT(error_for(format, "99999999999999999999999"), HasSubstr("c.ply:3"));
  }
}

TEST(Ply, AListLongerThanTheFileIsRefused) {
  const Scratch scratch;
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty list uint double e\n"
      "property float x\nproperty float y\nproperty float z\nend_header\n";
  append(bytes, 4'000'000'000U, std::endian::little);
  bytes.append(100, '\0');
  EXPECT_THAT(error_of<InputError>([&] { read_cloud(scratch.file("c.ply", bytes)); }),
              HasSubstr("ends inside vertex 0 of 1"));
}

TEST(Ply, LabelNamesMustBeUnambiguous) {
  const Scratch scratch;
  const auto error_with = [&](const std::string& comments) {
    const auto file = scratch.file("c.ply", "ply\nformat ascii 1.0\n" + comments +
                                                "element vertex 1\nproperty float x\nproperty "
                                                "float y\nproperty float z\nproperty int label\n"
                                                "end_header\n0 0 0 2\n");
    return error_of<InputError>([&] { read_cloud(file); });
  };
  EXPECT_EQ(error_with("comment label 2 leg\ncomment label 3 arm\n"), "");
  EXPECT_EQ(error_with("comment label of this file\n"), "");
  EXPECT_THAT(error_with("comment label 2 leg\ncomment label 2 arm\n"), HasSubstr("named twice"));
  EXPECT_THAT(error_with("comment label 2 leg\ncomment label 3 leg\n"), HasSubstr("two labels"));
}

// ---- PCD from elsewhere

std::string pcd(const std::string& counts, const std::string& data) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n" + counts +
         "VIEWPOINT 0 0 0 1 0 0 0\n" + data;
}

TEST(Pcd, ATruncatedFileIsRefusedAtEveryLength) {
  const Scratch scratch;
  Cloud cloud = full_cloud();
  write_cloud(scratch / "whole.pcd", cloud);
  expect_every_prefix_refused(scratch, "c.pcd", read_file(scratch / "whole.pcd"));
  const std::string ascii = pcd("WIDTH 2\nHEIGHT 1\nPOINTS 2\n", "DATA ascii\n0 0 0\n1 1 1");
  expect_every_prefix_refused(scratch, "c.pcd", ascii);
  EXPECT_EQ(read_cloud(scratch.file("c.pcd", ascii)).size(), 2U);
}

TEST(Pcd, FaultsAreNamedAndPclPrintsNothing) {
  const Scratch scratch;
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const auto error_in = [&](const std::string& bytes) {
    const auto file = scratch.file("bad.pcd", bytes);
    return error_of<InputError>([&] { read_cloud(file); });
  };
  const std::string two = "WIDTH 2\nHEIGHT 1\nPOINTS 2\n";
  EXPECT_THAT(error_in("hello\n"), HasSubstr("bad.pcd:1: unknown PCD header line 'hello'"));
  EXPECT_THAT(error_in(""), HasSubstr("not a PCD file"));
  EXPECT_THAT(error_in(pcd(two, "DATA morse\n")), HasSubstr("'morse'"));
  EXPECT_THAT(error_in(pcd("WIDTH 3\nHEIGHT 1\nPOINTS 2\n", "DATA ascii\n0 0 0\n1 1 1\n")),
              HasSubstr("WIDTH x HEIGHT"));
  EXPECT_THAT(error_in(pcd(two, "DATA ascii\n0 0 0\n1 1\n")), HasSubstr("bad.pcd:13: 2 values"));
  EXPECT_THAT(error_in(pcd(two, "DATA ascii\n0 0 0\n1 1 one\n")), HasSubstr("bad.pcd:13: 'one'"));
  EXPECT_THAT(error_in(pcd(two, "DATA ascii\n0 0 0\n1 1 1\n2 2 2\n")), HasSubstr("more points"));
  EXPECT_THAT(error_in(pcd("WIDTH 0\nHEIGHT 1\nPOINTS 0\n", "DATA ascii\n")),
              HasSubstr("no points"));
  EXPECT_THAT(error_in("FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nWIDTH 1\nHEIGHT 1\nDATA ascii\n"
                       "1 2\n"),
              HasSubstr("lacks the fields x y z"));
  EXPECT_THAT(error_in("FIELDS x y z\nSIZE 4 4 3\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n"),
              HasSubstr("field 'z'"));
  EXPECT_THAT(error_in("FIELDS x y z\nSIZE 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n"),
              HasSubstr("'SIZE' needs 3"));
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(Pcd, RefusesHugePromisesBeforeAllocating) {
  const Scratch scratch;
  const auto error_for = [&](const std::string& count, const std::string& data) {
    const auto file = scratch.file(
        "c.pcd", pcd("WIDTH " + count + "\nHEIGHT 1\nPOINTS " + count + "\n", "DATA " + data));
    return error_of<InputError>([&] { read_cloud(file); });
  };
  for (const char* encoding : {"ascii\n", "binary\n", "binary_compressed\n"}) {
    EXPECT_THAT(error_for("4000000000", encoding), HasSubstr("4000000000 points"));
    EXPECT_THAT(error_for("20000000", std::string(encoding) + "0 0 0\n"), HasSubstr("c.pcd"));
  }
  std::string bomb = "binary_compressed\n";
  append(bomb, std::uint32_t{100}, std::endian::little);
  append(bomb, std::uint32_t{240'000'000}, std::endian::little);
  bomb.append(100, '\0');
  EXPECT_THAT(error_for("20000000", bomb), HasSubstr("do not hold 20000000 points"));
}

TEST(Pcd, DamagedCompressedDataAreRefused) {
  const Scratch scratch;
  std::string data = "DATA binary_compressed\n";
  append(data, std::uint32_t{4}, std::endian::little);
  append(data, std::uint32_t{24}, std::endian::little);
  data += "\x03\x01\x02\x03";
  const auto file = scratch.file("c.pcd", pcd("WIDTH 2\nHEIGHT 1\nPOINTS 2\n", data));
  testing::internal::CaptureStderr();
  EXPECT_THAT(error_of<InputError>([&] { read_cloud(file); }), HasSubstr("c.pcd"));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(Pcd, ReadsTheBunny) {
  COSEGRAPH_NEEDS_DATA("pcl/bun0.pcd");
  const Cloud cloud = read_cloud(test::data_folder() / "pcl/bun0.pcd");
  ASSERT_EQ(cloud.size(), 397U);
  EXPECT_FLOAT_EQ(cloud.xyz[0], 0.0054215998F);
  EXPECT_FLOAT_EQ(cloud.normal[2], -0.87609947F);
  check_sizes(cloud);
}

TEST(Pcd, ReadsACompressedSensorCloud) {
  const char* name = "pcl/table_scene_mug_stereo_textured.pcd";
  COSEGRAPH_NEEDS_DATA(name);
  const Cloud cloud = read_cloud(test::data_folder() / name);
  EXPECT_EQ(cloud.width, 640U);
  EXPECT_EQ(cloud.height, 480U);
  check_sizes(cloud);
  ASSERT_EQ(cloud.rgb.size(), cloud.xyz.size());
  std::size_t finite = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) finite += std::isfinite(cloud.xyz[3 * i]) ? 1 : 0;
  EXPECT_GT(finite, 100'000U);
  EXPECT_LT(finite, cloud.size());
}

TEST(CloudIo, KnowsItsExtensions) {
  for (const char* name : {"a.ply", "a.PCD", "b/c.png"}) EXPECT_TRUE(is_cloud_file(name)) << name;
  for (const char* name : {"a.off", "ply", "a.txt", ""}) EXPECT_FALSE(is_cloud_file(name)) << name;
  EXPECT_THAT(error_of<InputError>([] { read_cloud("a.txt"); }), HasSubstr("a.txt"));
}

}  // namespace
}  // namespace cosegraph::io
