#include "model/model.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>

#include "core/error.hpp"

namespace cosegraph::model {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

// Layout: magic, version, size of the payload, checksum of version and payload, payload. The
// payload holds two sections, each a tag and a size. Text and lists start with their length.
constexpr std::string_view kMagic{"COSEGRAPH-MODEL\0", 16};
constexpr std::size_t kHeaderSize = 16 + 4 + 8 + 8;
constexpr std::string_view kAppearance = "APPE";
constexpr std::string_view kRelation = "RELA";

// FNV-1a, 64 bits. Every step is a bijection of the state, so any single wrong byte is noticed.
class Checksum {
 public:
  void add(std::string_view bytes) {
    for (const char byte : bytes) {
      state_ ^= static_cast<unsigned char>(byte);
      state_ *= 0x100000001b3ULL;
    }
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325ULL;
};

template <class T>
std::string_view bytes_of(const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

std::uint64_t checksum(std::uint32_t version, std::string_view payload) {
  Checksum sum;
  sum.add(bytes_of(version));
  sum.add(payload);
  return sum.value();
}

class Writer {
 public:
  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(const T& value) { bytes_.append(bytes_of(value)); }
  void operator()(const std::string& text) {
    (*this)(std::uint64_t{text.size()});
    bytes_.append(text);
  }
  template <class T>
  void operator()(const std::vector<T>& list) {
    (*this)(std::uint64_t{list.size()});
    if constexpr (std::is_arithmetic_v<T>) {
      bytes_.append(reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T));
    } else {
      for (const T& element : list) visit(*this, element);
    }
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : rest_(bytes) {}

  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(T& value) { std::memcpy(&value, next(sizeof value).data(), sizeof value); }
  void operator()(std::string& text) { text = next(length(1)); }
  template <class T>
  void operator()(std::vector<T>& list) {
    if constexpr (std::is_arithmetic_v<T>) {
      list.resize(length(sizeof(T)));
      const std::string_view bytes = next(list.size() * sizeof(T));
      if (!list.empty()) std::memcpy(list.data(), bytes.data(), bytes.size());
    } else {
      list.resize(length(1));
      for (T& element : list) visit(*this, element);
    }
  }

  std::string_view next(std::uint64_t size) {
    if (size > rest_.size()) throw InputError("inconsistent: a list is longer than the data");
    const std::string_view result = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return result;
  }
  bool at_end() const { return rest_.empty(); }

 private:
  // A number of elements of at least `element_size` bytes each, never more than there can be.
  std::uint64_t length(std::size_t element_size) {
    std::uint64_t count = 0;
    (*this)(count);
    if (count > rest_.size() / element_size)
      throw InputError("inconsistent: a list is longer than the data");
    return count;
  }

  std::string_view rest_;
};

// The fields in the order of the file; one list for reading and writing.
template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, std::string>
void visit(Archive& archive, T& text) {
  archive(text);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, AppearanceChannel>
void visit(Archive& archive, T& channel) {
  archive(channel.name);
  archive(channel.dimension);
  archive(channel.projection.input);
  archive(channel.projection.output);
  archive(channel.projection.mean);
  archive(channel.projection.basis);
  archive(channel.mixture.components);
  archive(channel.mixture.dimension);
  archive(channel.mixture.weight);
  archive(channel.mixture.mean);
  archive(channel.mixture.sigma);
  archive(channel.block_scale);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, AppearanceModel>
void visit(Archive& archive, T& model) {
  archive(model.id);
  archive(model.label_names);
  archive(model.label_share);
  archive(model.cloud_recipe);
  archive(model.descriptor_recipe);
  archive(model.encoding_recipe);
  archive(model.channels);
  archive(model.classifier.kernel);
  archive(model.classifier.dimension);
  archive(model.classifier.label_count);
  archive(model.classifier.weight);
  archive(model.classifier.support);
  archive(model.classifier.coefficient);
  archive(model.classifier.bias);
  archive(model.classifier.gamma);
  archive(model.classifier.sharpness);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, DistanceMixture>
void visit(Archive& archive, T& mixture) {
  archive(mixture.weight);
  archive(mixture.mean);
  archive(mixture.sigma);
}

template <class Archive, class T>
requires std::is_same_v<std::remove_const_t<T>, RelationModel>
void visit(Archive& archive, T& model) {
  archive(model.id);
  archive(model.label_names);
  archive(model.spectrum_recipe);
  archive(model.pairs);
  archive(model.neighbours);
}

template <class T>
std::string section(std::string_view tag, const T& value) {
  Writer writer;
  visit(writer, value);
  const std::string body = writer.take();
  Writer size;
  size(std::uint64_t{body.size()});
  return std::string(tag) + size.take() + body;
}

template <class T>
T read_section(Reader& reader, std::string_view tag) {
  if (reader.next(tag.size()) != tag)
    throw InputError("inconsistent: no section " + std::string(tag));
  std::uint64_t size = 0;
  reader(size);
  Reader body(reader.next(size));
  T value;
  visit(body, value);
  if (!body.at_end())
    throw InputError("inconsistent: section " + std::string(tag) + " has left-over bytes");
  return value;
}

std::string payload(const Model& model) {
  return section(kAppearance, model.appearance) + section(kRelation, model.relation);
}

// The checked payload.
std::string_view open(std::string_view bytes) {
  const std::string_view magic = bytes.substr(0, kMagic.size());
  if (magic != kMagic.substr(0, magic.size()) || magic.empty())
    throw InputError("not a cosegraph model");
  if (bytes.size() < kHeaderSize) throw InputError("truncated in its header");
  Reader header(bytes.substr(kMagic.size()));
  std::uint32_t version = 0;
  std::uint64_t size = 0;
  std::uint64_t expected = 0;
  header(version);
  header(size);
  header(expected);
  if (version > kFormatVersion)
    throw InputError("model format " + std::to_string(version) +
                     " was made by a newer version; this one reads up to " +
                     std::to_string(kFormatVersion));
  if (version < 1) throw InputError("damaged: model format 0");
  const std::string_view payload = bytes.substr(kHeaderSize);
  if (payload.size() < size)
    throw InputError("truncated: " + std::to_string(payload.size()) + " of " +
                     std::to_string(size) + " bytes");
  if (payload.size() > size) throw InputError("damaged: bytes after the end");
  if (checksum(version, payload) != expected) throw InputError("damaged: wrong checksum");
  return payload;
}

void require(bool fine, const std::string& what) {
  if (!fine) throw InputError("inconsistent: " + what);
}

bool all_finite(const std::vector<float>& values) {
  return std::ranges::all_of(values, [](float v) { return std::isfinite(v); });
}

// Finite and above 0; subnormal numbers are not, since 1 / x must be finite too.
bool all_positive(const std::vector<float>& values) {
  return std::ranges::all_of(
      values, [](float v) { return std::isfinite(v) && v >= std::numeric_limits<float>::min(); });
}

// Not negative, with sum 1.
bool is_distribution(const std::vector<float>& weights) {
  double sum = 0.0;
  for (const float w : weights) {
    if (!(w >= 0.0F)) return false;
    sum += w;
  }
  return std::abs(sum - 1.0) < 1e-3;
}

// `rows` x `columns` numbers; both are below 2^32.
bool has_size(const std::vector<float>& values, std::int64_t rows, std::int64_t columns) {
  return rows >= 0 && columns >= 0 &&
         static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns) == values.size();
}

void check_names(const std::vector<std::string>& names) {
  require(!names.empty(), "no labels");
  for (const std::string& name : names) require(!name.empty(), "a label without a name");
  for (std::size_t i = 1; i < names.size(); ++i)
    require(names[i - 1] < names[i], "label names are not sorted, or not unique");
}

void check_projection(const Projection& p, std::int32_t dimension, const std::string& where) {
  require(all_finite(p.mean) && all_finite(p.basis), where + ": projection is not finite");
  if (p.output == 0) {
    require(p.mean.empty() && p.basis.empty(), where + ": numbers of a projection that is none");
    return;
  }
  require(p.output > 0 && p.input == dimension && p.output <= p.input,
          where + ": projection does not fit the descriptors");
  require(has_size(p.mean, 1, p.input) && has_size(p.basis, p.output, p.input),
          where + ": wrong number of projection values");
}

void check_mixture(const GaussianMixture& m, std::int32_t dimension, const std::string& where) {
  require(m.components > 0, where + ": mixture without components");
  require(m.dimension == dimension, where + ": mixture does not fit the descriptors");
  require(has_size(m.weight, 1, m.components) && has_size(m.mean, m.components, m.dimension) &&
              has_size(m.sigma, m.components, m.dimension),
          where + ": wrong number of mixture values");
  require(all_positive(m.weight) && is_distribution(m.weight),
          where + ": weights are no distribution");
  require(all_finite(m.mean), where + ": means are not finite");
  require(all_positive(m.sigma), where + ": deviations are not positive");
}

void check_channel(const AppearanceChannel& channel) {
  const std::string where = "channel '" + channel.name + "'";
  require(!channel.name.empty(), "a channel without a name");
  require(channel.dimension > 0, where + ": no dimension");
  check_projection(channel.projection, channel.dimension, where);
  check_mixture(channel.mixture,
                channel.projection.output > 0 ? channel.projection.output : channel.dimension,
                where);
  require(std::isfinite(channel.block_scale) && channel.block_scale > 0.0F,
          where + ": block scale is not positive");
}

void check_classifier(const Classifier& c, std::size_t labels) {
  require(c.label_count > 0 && static_cast<std::size_t>(c.label_count) == labels,
          "classifier and labels differ in number");
  require(has_size(c.bias, 1, c.label_count), "wrong number of classifier biases");
  require(all_finite(c.weight) && all_finite(c.support) && all_finite(c.coefficient) &&
              all_finite(c.bias),
          "classifier is not finite");
  require(std::isfinite(c.sharpness) && c.sharpness > 0.0, "sharpness is not positive");
  require(c.kernel == "linear" || c.kernel == "rbf", "unknown kernel '" + c.kernel + "'");
  const bool linear = c.kernel == "linear";
  require(has_size(c.weight, linear ? c.label_count : 0, c.dimension),
          "wrong number of classifier weights");
  if (linear) {
    require(c.support.empty() && c.coefficient.empty(), "linear classifier with support vectors");
    return;
  }
  require(std::isfinite(c.gamma) && c.gamma > 0.0, "gamma is not positive");
  const auto support = static_cast<std::int64_t>(c.support.size()) / c.dimension;
  require(
      has_size(c.support, support, c.dimension) && has_size(c.coefficient, c.label_count, support),
      "wrong number of support vectors");
}

// Length of packet vectors: 2 K D per channel for Fisher vectors, K for bags of words.
void check_vector_length(const AppearanceModel& model) {
  std::int64_t fisher = 0;
  std::int64_t words = 0;
  for (const AppearanceChannel& channel : model.channels) {
    fisher += 2 * std::int64_t{channel.mixture.components} * channel.mixture.dimension;
    words += channel.mixture.components;
  }
  const std::int64_t dimension = model.classifier.dimension;
  require(dimension > 0 && (dimension == fisher || dimension == words),
          "classifier does not fit the channels");
}

void check_distances(const DistanceMixture& mixture) {
  const std::size_t size = mixture.weight.size();
  require(mixture.mean.size() == size && mixture.sigma.size() == size,
          "wrong number of values of a pair's mixture");
  if (size == 0) return;
  require(is_distribution(mixture.weight), "weights of a pair are no distribution");
  require(all_finite(mixture.mean), "means of a pair are not finite");
  require(all_positive(mixture.sigma), "deviations of a pair are not positive");
}

}  // namespace

std::string to_bytes(const Model& model) {
  const std::string body = payload(model);
  Writer header;
  header(kFormatVersion);
  header(std::uint64_t{body.size()});
  header(checksum(kFormatVersion, body));
  return std::string(kMagic) + header.take() + body;
}

Model from_bytes(std::string_view bytes, const std::string& name) {
  try {
    Reader reader(open(bytes));
    Model model;
    model.appearance = read_section<AppearanceModel>(reader, kAppearance);
    model.relation = read_section<RelationModel>(reader, kRelation);
    require(reader.at_end(), "left-over bytes");
    check(model.appearance);
    check(model.relation);
    require(model.appearance.id == model.relation.id &&
                model.appearance.label_names == model.relation.label_names,
            "its halves belong to different models");
    return model;
  } catch (const InputError& error) {
    throw InputError(name + ": " + error.what());
  }
}

std::uint64_t content_id(const Model& model) {
  Model anonymous = model;
  anonymous.appearance.id = 0;
  anonymous.relation.id = 0;
  const std::uint64_t id = checksum(kFormatVersion, payload(anonymous));
  return id == 0 ? 1 : id;
}

void check(const AppearanceModel& model) {
  check_names(model.label_names);
  require(
      model.label_share.size() == model.label_names.size() && is_distribution(model.label_share),
      "label shares are no distribution");
  require(!model.channels.empty(), "no descriptor channel");
  for (const AppearanceChannel& channel : model.channels) check_channel(channel);
  check_vector_length(model);
  check_classifier(model.classifier, model.label_names.size());
}

void check(const RelationModel& model) {
  check_names(model.label_names);
  const std::size_t labels = model.label_names.size();
  require(model.neighbours.size() == labels * labels, "wrong number of neighbour flags");
  for (std::size_t a = 0; a < labels; ++a)
    for (std::size_t b = 0; b < labels; ++b) {
      const std::uint8_t flag = model.neighbours[a * labels + b];
      require(flag <= 1 && flag == model.neighbours[b * labels + a] && (a != b || flag == 1),
              "neighbour flags are not a symmetric relation");
    }
  require(model.pairs.size() == (model.spectrum_recipe.empty() ? 0 : labels * (labels + 1) / 2),
          "wrong number of part pairs");
  for (const DistanceMixture& mixture : model.pairs) check_distances(mixture);
}

}  // namespace cosegraph::model
