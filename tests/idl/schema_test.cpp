#include "idl/schema.hpp"

#include <gmock/gmock.h>

#include "core/error.hpp"
#include "idl/codec.hpp"

namespace cosegraph::idl {
namespace {

TEST(Schema, EveryTypeHasATextThatNeedsNoOther) {
  for (const auto type : type_names()) {
    const std::string text(idl_text(type));
    const std::size_t header = text.find("struct FrameHeader\n");
    const std::size_t definition = text.find("struct " + std::string(type) + "\n");
    ASSERT_NE(header, std::string::npos) << type;
    ASSERT_NE(definition, std::string::npos) << type;
    EXPECT_LT(header, definition) << type;
    EXPECT_EQ(text.find("#include"), std::string::npos) << type;
    EXPECT_EQ(text.find("struct FrameHeader\n", header + 1), std::string::npos) << type;
  }
}

TEST(Schema, UnknownTypesAreRefused) {
  EXPECT_THROW(idl_text("Teapot"), InputError);
  EXPECT_THROW(idl_text(""), InputError);
}

}  // namespace
}  // namespace cosegraph::idl
