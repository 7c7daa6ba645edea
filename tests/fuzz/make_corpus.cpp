// Writes the seeds of every target: fuzz-corpus FOLDER. All that is in them is computed here from a
// small scene (scene.hpp).
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>

#include "fuzz/scene.hpp"
#include "fuzz/target.hpp"
#include "io/file.hpp"

namespace {

using namespace cosegraph;
namespace fs = std::filesystem;

const idl::FrameHeader kHeader{.graph = "g", .stage = "s", .source = "s", .epoch = 1, .name = "f"};

class Corpus {
 public:
  explicit Corpus(fs::path folder) : folder_(std::move(folder)) {}

  void add(const std::string& target, const std::string& name, std::uint8_t choice,
           std::vector<idl::Bytes> messages) const {
    const idl::Bytes bytes = fuzz::pack({choice, std::move(messages)});
    fs::create_directories(folder_ / target);
    io::write_file(folder_ / target / name,
                   {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }

 private:
  fs::path folder_;
};

// All messages of one frame and of the model it is labelled with.
struct Messages {
  idl::Bytes cloud, supervoxels, segments, descriptors, spectrum, appearance, relations, encodings,
      scores, labelling;
};

Messages messages_of(const fuzz::Scene& scene) {
  const auto message = [](const auto& value) { return idl::encode(kHeader, value); };
  return {.cloud = message(scene.cloud),
          .supervoxels = message(scene.supervoxels),
          .segments = message(scene.segments),
          .descriptors = message(scene.descriptors),
          .spectrum = message(scene.spectrum),
          .appearance = message(scene.model.appearance),
          .relations = message(scene.model.relation),
          .encodings = message(scene.encodings),
          .scores = message(scene.scores),
          .labelling = message(scene.labelling)};
}

void add_decode_seeds(const Corpus& corpus, const Messages& m) {
  const idl::Bytes of_type[] = {
      m.cloud,
      m.supervoxels,
      m.segments,
      m.descriptors,
      m.encodings,
      m.scores,
      m.spectrum,
      m.labelling,
      m.appearance,
      m.relations,
      idl::encode(kHeader, idl::StreamEnd{3}),
      idl::encode(kHeader, idl::FrameFailure{"why"}),
      idl::encode(kHeader, idl::FrameDone{idl::Outcome::failed, "cpc", "why"}),
      idl::encode(kHeader, idl::StageStatus{.kind = "k", .ports = {{.name = "p", .topic = "t"}}}),
      idl::encode(kHeader, idl::Command{.id = 1, .verb = "drain", .words = {"a", "b"}}),
      idl::encode(kHeader, idl::Reply{.id = 1, .text = "t"}),
      idl::encode(kHeader, idl::AgentStatus{.host = "h", .processes = {{.stage = "s"}}}),
      idl::encode(kHeader, idl::LogLines{.host = "h", .lines = {"a", "b"}})};
  const auto types = idl::type_names();
  if (std::size(of_type) != types.size()) throw Error("a type has no seed");
  for (std::size_t i = 0; i < types.size(); ++i)
    corpus.add("decode", "seed-" + std::string(types[i]), static_cast<std::uint8_t>(i),
               {of_type[i]});
}

// `message` with its value changed.
template <class Value, class Change>
idl::Bytes with(const idl::Bytes& message, Change change) {
  Value value = idl::decode<Value>(message);
  change(value);
  return idl::encode(kHeader, value);
}

void scale_by(std::vector<float>& values, float factor) {
  for (float& value : values) value *= factor;
}

// Values that once did harm, or would have.
void add_hostile_clouds(const Corpus& corpus, const Messages& m) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto add = [&](const std::string& name, auto change) {
    const idl::Bytes cloud = with<Cloud>(m.cloud, change);
    corpus.add("clouds", "hostile-" + name, 6, {cloud});
    if (name.starts_with("far") || name == "nan") {
      corpus.add("segments", "hostile-" + name, 3,
                 {cloud, m.descriptors, m.segments, m.appearance});
      corpus.add("labels", "hostile-" + name, 1, {cloud, m.segments, m.labelling});
    }
  };
  add("far", [](Cloud& cloud) { scale_by(cloud.xyz, 1e25F); });
  add("far-point", [](Cloud& cloud) { cloud.xyz[0] = 3e38F; });
  add("one-place", [](Cloud& cloud) { std::ranges::fill(cloud.xyz, 1.0F); });
  add("nan", [](Cloud& cloud) { cloud.xyz[4] = kNan; });
  add("tiny-scale", [](Cloud& cloud) { cloud.scale = 1e-37F; });
  add("huge-scale", [](Cloud& cloud) { cloud.scale = 1e37F; });
}

void add_hostile_pictures(const Corpus& corpus, const Messages& m) {
  const auto add = [&](const std::string& name, const idl::Bytes& cloud, const idl::Bytes& segments,
                       const idl::Bytes& labelling) {
    corpus.add("labels", "hostile-" + name, 1, {cloud, segments, labelling});
  };
  const idl::Bytes unlabelled = with<Cloud>(m.cloud, [](Cloud& cloud) {
    cloud.label.clear();
    cloud.label_names.clear();
  });
  const idl::Bytes longer = with<Cloud>(unlabelled, [](Cloud& cloud) {
    cloud.dense_index.clear();
    cloud.xyz.resize(cloud.xyz.size() + 30, 2.0F);
    cloud.normal.clear();
    cloud.width += 10;
  });
  add("no-dense-index", with<Cloud>(unlabelled, [](Cloud& cloud) { cloud.dense_index.clear(); }),
      m.segments, m.labelling);
  add("more-points", longer, m.segments, m.labelling);
  add("fewer-segmented", unlabelled,
      with<Segments>(m.segments, [](Segments& segments) { segments.of_point.resize(3); }),
      m.labelling);
  add("not-utf8", with<Cloud>(unlabelled, [](Cloud& cloud) { cloud.notes = {"\xff\xfe"}; }),
      m.segments, with<Labelling>(m.labelling, [](Labelling& l) { l.label_names[0] = "\xc3"; }));
  add("long-name", unlabelled, m.segments, with<Labelling>(m.labelling, [](Labelling& labelling) {
        labelling.label_names[0] = std::string(4000, 'w');
      }));
}

void add_hostile_rest(const Corpus& corpus, const Messages& m) {
  constexpr std::uint8_t kScores = 5;  // among idl::type_names()
  corpus.add("decode", "hostile-no-columns", kScores,
             {with<Scores>(m.scores, [](Scores& scores) { scores.label_names.clear(); })});
  corpus.add("segments", "hostile-nan-vector", 2,
             {with<Encodings>(m.encodings, [](Encodings& e) { e.value[0] = std::nanf(""); }),
              m.appearance});
  corpus.add("segments", "hostile-many", 2,
             {idl::encode(kHeader, Encodings{.segment_count = std::numeric_limits<int>::max(),
                                             .dimension = 1}),
              m.appearance});
  corpus.add("segments", "hostile-repeated", 3,
             {m.cloud, m.descriptors,
              with<Segments>(m.segments,
                             [](Segments& segments) {
                               segments.adjacency.assign(50, {0, 1});
                               segments.concavity.assign(50, 0.0F);
                             }),
              m.appearance});
  corpus.add("segments", "hostile-spread", 0,
             {with<Supervoxels>(m.supervoxels, [](Supervoxels& supervoxels) {
               supervoxels.seed_resolution = 1e-37F;
               scale_by(supervoxels.centroid, 1e30F);
             })});
  const idl::Bytes spectrum =
      with<Spectrum>(m.spectrum, [](Spectrum& s) { std::ranges::fill(s.eigenvalue, 1e-44F); });
  corpus.add("labels", "hostile-eigenvalues", 3, {m.scores, m.segments, spectrum, m.relations});
  corpus.add("training", "hostile-eigenvalues", 0, {m.cloud, m.descriptors, spectrum});
  corpus.add("training", "hostile-distances", 0,
             {m.cloud, m.descriptors,
              with<Spectrum>(m.spectrum, [](Spectrum& s) { scale_by(s.eigenfunction, 1e37F); })});
}

void write_corpus(const Corpus& corpus) {
  training::Params bow = fuzz::small_training();
  bow.encoding.method = fisher::Method::bow;
  const Messages m = messages_of(fuzz::make_scene(fuzz::small_training()));
  const Messages words = messages_of(fuzz::make_scene(bow));

  add_decode_seeds(corpus, m);
  add_hostile_clouds(corpus, m);
  add_hostile_pictures(corpus, m);
  add_hostile_rest(corpus, m);
  for (const std::uint8_t choice : {0, 1, 2, 3, 4, 5, 6})
    corpus.add("clouds", "seed-" + std::to_string(choice), choice, {m.cloud});
  corpus.add("segments", "seed-concavity", 0, {m.supervoxels});
  corpus.add("segments", "seed-size", 1, {m.supervoxels});
  corpus.add("segments", "seed-linear", 2, {m.encodings, m.appearance});
  corpus.add("segments", "seed-rbf", 2, {words.encodings, words.appearance});
  corpus.add("segments", "seed-fv", 3, {m.cloud, m.descriptors, m.segments, m.appearance});
  corpus.add("segments", "seed-bow", 3,
             {words.cloud, words.descriptors, words.segments, words.appearance});
  for (const std::uint8_t choice : {0, 3, 6, 12})
    corpus.add("labels", "seed-astar-" + std::to_string(choice), choice,
               {m.scores, m.segments, m.spectrum, m.relations});
  corpus.add("labels", "seed-picture", 1, {m.cloud, m.segments, m.labelling});
  corpus.add("labels", "seed-figures", 2, {m.cloud, m.segments, m.labelling});
  for (const std::uint8_t choice : {0, 1})
    corpus.add("training", "seed-" + std::to_string(choice), choice,
               {m.cloud, m.descriptors, m.spectrum});
  corpus.add("training", "seed-two", 2,
             {m.cloud, m.descriptors, m.spectrum, m.cloud, m.descriptors, m.spectrum});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 || argv[1][0] == '-') {
    std::cerr << "usage: fuzz-corpus FOLDER\n";
    return 2;
  }
  try {
    write_corpus(Corpus(argv[1]));
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "fuzz-corpus: " << error.what() << '\n';
    return 1;
  }
}
