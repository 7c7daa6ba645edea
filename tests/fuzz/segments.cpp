// From supervoxels and descriptors to scores: cutting, encoding, classifying.
#include "cpc/cpc.hpp"
#include "fisher/fisher.hpp"
#include "fuzz/target.hpp"
#include "svm/svm.hpp"

namespace cosegraph::fuzz {

std::vector<std::string_view> types_of(std::uint8_t choice) {
  if (choice % 4 < 2) return {"Supervoxels"};
  if (choice % 4 == 2) return {"Encodings", "AppearanceModel"};
  return {"Cloud", "Descriptors", "Segments", "AppearanceModel"};
}

void run(const Bundle& bundle) {
  const auto& messages = bundle.messages;
  if (messages.size() < types_of(bundle.choice).size()) return;
  try {
    switch (bundle.choice % 4) {
      case 0:
      case 1: {
        const auto merge = bundle.choice % 4 == 0 ? cpc::Merge::concavity : cpc::Merge::size;
        const auto supervoxels = idl::decode<Supervoxels>(messages[0]);
        idl::decode<Segments>(idl::encode({}, cpc::compute(supervoxels, {.merge = merge})));
        return;
      }
      case 2:
        idl::decode<Scores>(idl::encode({}, svm::score(idl::decode<Encodings>(messages[0]),
                                                       idl::decode<AppearanceModel>(messages[1]))));
        return;
      default: {
        const auto model = idl::decode<AppearanceModel>(messages[3]);
        const auto encodings = idl::decode<Encodings>(idl::encode(
            {}, fisher::encode_segments(
                    idl::decode<Cloud>(messages[0]), idl::decode<Descriptors>(messages[1]),
                    idl::decode<Segments>(messages[2]), model, {.clusters = 3, .packets = 2})));
        idl::decode<Scores>(idl::encode({}, svm::score(encodings, model)));
      }
    }
  } catch (const Error&) {
    return;
  }
}

}  // namespace cosegraph::fuzz
