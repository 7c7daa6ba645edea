// Clouds as foxglove.PointCloud messages, which other viewers draw: CDR of the type's OMG IDL.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/cloud.hpp"
#include "idl/codec.hpp"

namespace cosegraph::monitor {

constexpr std::string_view kPointCloudSchemaName = "foxglove::PointCloud";
extern const std::string_view kPointCloudSchema;

// Per point x y z and red green blue alpha; with `id` (a label, a segment; as long as the cloud)
// also that number, and its colour instead of the cloud's own. Points of id kNoLabel are grey.
// `stamp` in ns since 1970.
idl::Bytes encode_point_cloud(const Cloud& cloud, std::span<const std::int32_t> id,
                              std::string_view id_name, std::int64_t stamp);

}  // namespace cosegraph::monitor
