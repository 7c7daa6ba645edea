#include "descriptors/descriptors.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>

#include "core/nearest.hpp"
#include "core/random.hpp"
#include "descriptors/local.hpp"
#include "descriptors/place.hpp"

namespace cosegraph::descriptors {
namespace {

using Indices = std::vector<std::int32_t>;

constexpr std::string_view kPlaceSuffix = "+place";
constexpr std::size_t kMostPairs = 2'000'000'000;  // of points and their neighbours, per channel
constexpr std::size_t kProbes = 512;               // points whose neighbours are counted beforehand

std::string shortest(double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  return {buffer, end};
}

double default_spacing(Kind kind) {
  return kind == Kind::shot ? kShotSpacing : 0.0;
}

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(':', begin), text.size());
    parts.emplace_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

double parse_length(const std::string& text, const char* what, double min) {
  double value = 0.0;
  try {
    number_field(what, value, min, 10.0, "scale", "").set({text});
  } catch (const ParameterError& error) {
    throw ParameterError(std::string(what) + " " + error.what());
  }
  return value;
}

Channel parse_parts(std::vector<std::string> part) {
  Channel channel;
  if (part[0].ends_with(kPlaceSuffix)) {
    channel.with_place = true;
    part[0].resize(part[0].size() - kPlaceSuffix.size());
  }
  channel.kind = from_name<Kind>(part[0]);
  if (channel.kind == Kind::place) {
    if (part.size() > 1 || channel.with_place)
      throw ParameterError("'place' stands alone, without a radius");
    return channel;
  }
  if (part.size() < 2) throw ParameterError("the radius is missing, as in 'fpfh:0.08'");
  if (part.size() > 3) throw ParameterError("expected KIND[+place]:RADIUS[:SPACING]");
  channel.radius = parse_length(part[1], "radius", 1e-3);
  channel.spacing =
      part.size() == 3 ? parse_length(part[2], "spacing", 0.0) : default_spacing(channel.kind);
  return channel;
}

std::vector<Channel> parse_channels(const std::vector<std::string>& texts) {
  if (texts.empty()) throw ParameterError("channels: none is given");
  std::vector<Channel> channels;
  for (const auto& text : texts) {
    const Channel channel = parse_channel(text);
    if (std::ranges::find(channels, channel) != channels.end())
      throw ParameterError("channels: '" + to_text(channel) + "' is given twice");
    channels.push_back(channel);
  }
  return channels;
}

void check(const Cloud& cloud) {
  const auto finite = [](float value) { return std::isfinite(value); };
  check_sizes(cloud);
  if (cloud.size() == 0) throw InputError("the cloud has no points to describe");
  if (cloud.normal.empty()) throw InputError("the cloud has no normals, descriptors need them");
  if (!(cloud.scale > 0.0F)) throw InputError("the cloud's scale is not positive");
  if (!std::ranges::all_of(cloud.xyz, finite)) throw InputError("a point is not finite");
  if (!std::ranges::all_of(cloud.normal, finite)) throw InputError("a normal is not finite");
}

// Time grows with the neighbours of all points: a scale that is wrong for the cloud makes each a
// neighbour of every other. Those of some points tell about how many there are.
void check_neighbourhoods(const Cloud& cloud, double radius) {
  if (cloud.size() <= kMostPairs / cloud.size()) return;
  const NearestNeighbours tree(cloud.xyz);
  Random random(1);
  std::size_t counted = 0;
  for (const std::int32_t i : random.sample(cloud.size(), kProbes)) {
    const float* point = &cloud.xyz[3 * static_cast<std::size_t>(i)];
    counted += tree.within(point, static_cast<float>(radius)).size();
    if (counted > kMostPairs / cloud.size() * kProbes)
      throw InputError("the points' neighbourhoods are too large: is the cloud's scale right?");
  }
}

// In the order of the cloud, every point that is no nearer than `spacing` to one already chosen.
Indices choose_keypoints(const Cloud& cloud, double spacing) {
  Indices chosen(cloud.size());
  std::iota(chosen.begin(), chosen.end(), 0);
  if (!(spacing > 0.0)) return chosen;
  const NearestNeighbours tree(cloud.xyz);
  std::vector<char> taken(cloud.size(), 0);
  std::erase_if(chosen, [&](std::int32_t i) {
    if (taken[i]) return true;
    const float* point = &cloud.xyz[3 * static_cast<std::size_t>(i)];
    for (const auto& near : tree.within(point, static_cast<float>(spacing))) taken[near.index] = 1;
    return false;
  });
  return chosen;
}

std::vector<float> local_rows(const Cloud& cloud, const Channel& channel, const Indices& keypoint,
                              const Params& params) {
  const Surface surface{cloud.xyz, cloud.normal};
  const double radius = channel.radius * cloud.scale;
  check_neighbourhoods(cloud, radius);
  if (channel.kind == Kind::fpfh)
    return fpfh(surface, keypoint, radius, params.threads, params.kernel);
  if (channel.kind == Kind::shot)
    return shot(surface, keypoint, radius, params.threads, params.kernel);
  return {};
}

// Row after row the local descriptor and, if wanted, the place; rows that are not finite go.
DescriptorChannel compute_channel(const Cloud& cloud, const Channel& channel,
                                  const std::vector<float>& places, const Params& params) {
  DescriptorChannel result{.name = to_text(channel), .dimension = dimension(channel)};
  const Indices keypoint = choose_keypoints(cloud, channel.spacing * cloud.scale);
  const std::vector<float> rows = local_rows(cloud, channel, keypoint, params);
  const std::size_t width = rows.size() / keypoint.size();
  const bool append_place = channel.with_place || channel.kind == Kind::place;
  result.value.reserve(keypoint.size() * result.dimension);
  for (std::size_t k = 0; k < keypoint.size(); ++k) {
    const std::span row = std::span(rows).subspan(k * width, width);
    if (!std::ranges::all_of(row, [](float value) { return std::isfinite(value); })) continue;
    result.keypoint.push_back(keypoint[k]);
    result.value.insert(result.value.end(), row.begin(), row.end());
    if (!append_place) continue;
    const auto at = places.begin() + static_cast<std::ptrdiff_t>(kPlaceSize) * keypoint[k];
    result.value.insert(result.value.end(), at, at + kPlaceSize);
  }
  if (result.keypoint.empty())
    throw InputError("channel '" + result.name + "': no point has enough neighbours");
  return result;
}

}  // namespace

std::string to_text(const Channel& channel) {
  std::string text(to_name(channel.kind));
  if (channel.kind == Kind::place) return text;
  if (channel.with_place) text += kPlaceSuffix;
  text += ":" + shortest(channel.radius);
  if (channel.spacing != 0.0 || default_spacing(channel.kind) != 0.0)
    text += ":" + shortest(channel.spacing);
  return text;
}

Channel parse_channel(std::string_view text) {
  try {
    return parse_parts(split(text));
  } catch (const ParameterError& error) {
    throw ParameterError("channel '" + std::string(text) + "': " + error.what());
  }
}

Fields describe(Params& params) {
  return {
      list_field("channels", params.channels,
                 "Descriptors KIND[+place]:RADIUS[:SPACING], lengths in scales.",
                 [](const std::string& text) { parse_channel(text); }),
      integer_field("threads", params.threads, 0, 1024, "",
                    "Threads of the computation; 0: all cores."),
      choice_field("kernel", params.kernel,
                   "What computes FPFH and SHOT; results are the same within rounding."),
  };
}

std::string recipe_of(const Params& params) {
  Params canonical;
  canonical.channels.clear();
  for (const auto& text : params.channels)
    canonical.channels.push_back(to_text(parse_channel(text)));
  const Fields fields = describe(canonical);
  return recipe({*find(fields, "channels")});
}

void adopt_recipe(std::string_view text, Params& params) {
  Fields fields = describe(params);
  std::erase_if(fields, [](const Field& field) { return field.name != "channels"; });
  apply_recipe(fields, text);
}

int dimension(const Channel& channel) {
  if (channel.kind == Kind::place) return kPlaceSize;
  const int local = channel.kind == Kind::fpfh ? kFpfhSize : kShotSize;
  return local + (channel.with_place ? kPlaceSize : 0);
}

Descriptors compute(const Cloud& cloud, const Params& params) {
  const std::vector<Channel> channels = parse_channels(params.channels);
  check(cloud);
  const auto uses_place = [](const Channel& channel) {
    return channel.with_place || channel.kind == Kind::place;
  };
  std::vector<float> places;
  if (std::ranges::any_of(channels, uses_place)) places = place(cloud.xyz, cloud.scale);
  Descriptors descriptors{.recipe = recipe_of(params)};
  for (const Channel& channel : channels)
    descriptors.channels.push_back(compute_channel(cloud, channel, places, params));
  return descriptors;
}

}  // namespace cosegraph::descriptors

template <>
cosegraph::Names<cosegraph::descriptors::Kind> cosegraph::names<cosegraph::descriptors::Kind>() {
  using cosegraph::descriptors::Kind;
  static constexpr std::pair<Kind, std::string_view> table[] = {
      {Kind::fpfh, "fpfh"}, {Kind::shot, "shot"}, {Kind::place, "place"}};
  return table;
}
