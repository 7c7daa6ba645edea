// Walks over an encoded message before it is decoded.
//
// The generated code allocates what a length field claims before it looks at what is there: four
// hostile bytes would cost 16 GB. A walk by the type's layout allocates nothing and finds such
// lengths, and truncation, first.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace cosegraph::idl {

// A layout has a character per member:
//   1 4 8  a number of so many bytes        b f  a sequence of bytes, of 4-byte numbers
//   s      a string                         S    a sequence of strings
//   [...]  a sequence of structs with the members in between
//
// True if `bytes` (CDR with encapsulation header, either byte order) holds a whole message of that
// layout. Bytes behind the message are allowed (padding).
bool fits_layout(std::span<const std::uint8_t> bytes, std::string_view layout);

}  // namespace cosegraph::idl
