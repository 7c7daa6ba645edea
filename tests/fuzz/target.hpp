// What a fuzz target is: messages from an unsecured domain, and what the stages do with them.
//
// The input of every target is a bundle of encoded messages, so that two messages that are each
// valid need not fit together. Nothing here knows libFuzzer: the same target is fuzzed
// (libfuzzer.cpp) and replayed as an ordinary test (replay_test.cpp).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/random.hpp"
#include "idl/codec.hpp"

namespace cosegraph::fuzz {

struct Bundle {
  std::uint8_t choice = 0;  // of what a target varies beside its messages: settings, the type
  std::vector<idl::Bytes> messages;
};

// A byte for the choice, then each message behind its length (4 bytes, little endian). A length
// beyond the end takes what is there: any bytes are a bundle.
Bundle unpack(std::span<const std::uint8_t> bytes);
idl::Bytes pack(const Bundle& bundle);

// Names of the types of the messages that a target takes (see idl::type_names()), in their order.
std::vector<std::string_view> types_of(std::uint8_t choice);

// Decodes the messages and hands them to the algorithms as the stages do. Refusal of an input by
// a cosegraph Error is fine and ends it.
void run(const Bundle& bundle);

// Changes a number, a list or the size of what one of the messages holds; messages that do not
// decode stay as they are. The result is encoded anew and need not decode.
void mutate(Bundle& bundle, Random& random);

}  // namespace cosegraph::fuzz
