// The IDL of every topic's type as text, for recordings and bridges: who reads it can decode our
// messages without our code.
#pragma once

#include <string_view>

namespace cosegraph::idl {

// The encoding of these texts in MCAP files and in the Foxglove protocol, and that of messages.
constexpr std::string_view kSchemaEncoding = "omgidl";
constexpr std::string_view kMessageEncoding = "cdr";

// A whole IDL file that defines `type` ("Cloud") as wire_type(type), without includes. Throws
// InputError for a type that does not travel.
std::string_view idl_text(std::string_view type);

}  // namespace cosegraph::idl
