// Every type that travels, by both readers: what decodes can be encoded, and is then the same; what
// is taken apart by its IDL can be shown.
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>

#include "fuzz/target.hpp"
#include "idl/members.hpp"
#include "idl/present.hpp"

namespace cosegraph::fuzz {
namespace {

template <class Value>
void check(std::string_view type, const idl::Bytes& bytes) {
  if (type != idl::type_name<Value>()) return;
  const Value value = idl::decode<Value>(bytes);
  idl::inspect(type, bytes);  // the other reader takes what this one takes
  const idl::FrameHeader header = idl::decode_header(bytes);
  const idl::Bytes once = idl::encode(header, value);
  const idl::Bytes twice = idl::encode(idl::decode_header(once), idl::decode<Value>(once));
  if (once == twice) return;
  std::cerr << type << " changes when it is decoded and encoded\n";
  std::abort();
}

template <class... Values>
void check_any(std::string_view type, const idl::Bytes& bytes) {
  (check<Values>(type, bytes), ...);
}

void show(std::string_view type, const idl::Bytes& bytes) {
  const idl::Node message = idl::inspect(type, bytes);
  for (const bool whole : {false, true}) {
    idl::to_text(message, {.whole = whole});
    idl::to_json(message, {.whole = whole}).dump();
  }
  idl::members_of(type, bytes);
}

}  // namespace

std::vector<std::string_view> types_of(std::uint8_t choice) {
  const auto names = idl::type_names();
  return {names[choice % names.size()]};
}

void run(const Bundle& bundle) {
  if (bundle.messages.empty()) return;
  const std::string_view type = types_of(bundle.choice)[0];
  const idl::Bytes& bytes = bundle.messages[0];
  try {
    show(type, bytes);
  } catch (const Error&) {
    // The readers do not rest on each other.
  }
  try {
    idl::decode_header(bytes);
    check_any<Cloud, Supervoxels, Segments, Descriptors, Encodings, Scores, Spectrum, Labelling,
              AppearanceModel, RelationModel, idl::StreamEnd, idl::FrameFailure, idl::FrameDone,
              idl::StageStatus, idl::Command, idl::Reply, idl::AgentStatus, idl::LogLines>(type,
                                                                                           bytes);
  } catch (const Error&) {
    return;
  }
}

}  // namespace cosegraph::fuzz
