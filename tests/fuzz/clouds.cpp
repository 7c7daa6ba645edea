// What is made of a cloud: supervoxels and segments, descriptors, spectra.
#include "cpc/cpc.hpp"
#include "descriptors/descriptors.hpp"
#include "fuzz/target.hpp"
#include "spectra/spectra.hpp"
#include "supervoxels/supervoxels.hpp"

namespace cosegraph::fuzz {
namespace {

void segment(const Cloud& cloud) {
  const idl::FrameHeader header;
  const auto supervoxels = idl::decode<Supervoxels>(
      idl::encode(header, supervoxels::compute(cloud, {.voxel = 0.05, .seed = 0.2})));
  idl::decode<Segments>(idl::encode(header, cpc::compute(supervoxels, {})));
}

void describe(const Cloud& cloud, const std::string& channel) {
  idl::decode<Descriptors>(
      idl::encode({}, descriptors::compute(cloud, {.channels = {channel}, .threads = 1})));
}

void decompose(const Cloud& cloud, spectra::Operator op) {
  idl::decode<Spectrum>(
      idl::encode({}, spectra::compute(cloud, {.op = op, .samples = 40, .eigenpairs = 4})));
}

}  // namespace

std::vector<std::string_view> types_of(std::uint8_t) {
  return {"Cloud"};
}

void run(const Bundle& bundle) {
  if (bundle.messages.empty()) return;
  if (bundle.choice % 7 == 6) {  // all of them
    for (std::uint8_t choice = 0; choice < 6; ++choice) run({choice, bundle.messages});
    return;
  }
  try {
    const auto cloud = idl::decode<Cloud>(bundle.messages[0]);
    switch (bundle.choice % 7) {
      case 0:
        return segment(cloud);
      case 1:
        return describe(cloud, "fpfh:0.3");
      case 2:
        return describe(cloud, "shot:0.3:0.2");
      case 3:
        return describe(cloud, "place");
      case 4:
        return decompose(cloud, spectra::Operator::weak);
      default:
        return decompose(cloud, spectra::Operator::mls);
    }
  } catch (const Error&) {
    return;
  }
}

}  // namespace cosegraph::fuzz
