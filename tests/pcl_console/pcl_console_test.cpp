#include "pcl_console/pcl_console.hpp"

#include <gtest/gtest.h>
#include <pcl/console/print.h>

namespace cosegraph {
namespace {

std::string printed_by_pcl() {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  PCL_ERROR("of PCL\n");
  PCL_WARN("of PCL\n");
  PCL_INFO("of PCL\n");
  return testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr();
}

TEST(PclConsole, IsSilentOnceSilenced) {
  EXPECT_NE(printed_by_pcl(), "");
  silence_pcl();
  EXPECT_EQ(printed_by_pcl(), "");
  silence_pcl();
  EXPECT_EQ(printed_by_pcl(), "");
}

}  // namespace
}  // namespace cosegraph
