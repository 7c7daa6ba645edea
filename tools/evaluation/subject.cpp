#include "tools/evaluation/subject.hpp"

#include <algorithm>
#include <mutex>

#include <nlohmann/json.hpp>

#include "inputs/inputs.hpp"
#include "tools/evaluation/surface.hpp"

namespace cosegraph::camera {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(View, direction, roll)

}  // namespace cosegraph::camera

namespace cosegraph::evaluation {

// Read when it is first asked for: not at all if everything that is seen of it is in the store.
class Subject::LazyMesh {
 public:
  explicit LazyMesh(const Shape& shape) : shape_(shape) {}

  const Mesh& get() {
    std::call_once(read_,
                   [this] { mesh_ = inputs::read_labelled_mesh(shape_.mesh, shape_.labels); });
    return mesh_;
  }

 private:
  Shape shape_;
  std::once_flag read_;
  Mesh mesh_;
};

Subject::Subject(const Shape& shape, std::string fingerprint, const std::string& category,
                 std::uint64_t seed, const Protocol& protocol)
    : shape_(shape),
      where_(category + "/" + shape.name),
      seed_(shape_seed(seed, category, shape.name)),
      camera_(protocol.camera),
      wanted_train_views_(static_cast<std::size_t>(protocol.train_views)),
      query_views_(static_cast<std::size_t>(protocol.query_views)),
      flawed_allowed_(protocol.flawed),
      mesh_(std::make_shared<LazyMesh>(shape)) {
  camera_.count = std::max(protocol.query_views, protocol.train_views);
  camera_.seed = camera_seed(seed_);
  key_ = "shape " + fingerprint + '\n' + recipe(camera::describe(camera_)) + '\n' +
         (flawed_allowed_ ? "flawed too" : "sound only") + '\n';
}

std::string Subject::where(std::size_t view) const {
  return where_ + " view " + std::to_string(view);
}

std::size_t Subject::train_views() const {
  return std::min(views.size(), wanted_train_views_);
}

void Subject::open(Store& store) {
  try {
    if (const auto record = store.read(key_ + "views")) {
      label_names = nlohmann::json::parse(record->at(0)).get<std::vector<std::string>>();
      directions_ = nlohmann::json::parse(record->at(1)).get<std::vector<camera::View>>();
    } else {
      check_surface();
      label_names = mesh_->get().label_names;
      directions_ = camera::choose_views(mesh_->get(), camera_);
      store.write(key_ + "views", std::vector{nlohmann::json(label_names).dump(),
                                              nlohmann::json(directions_).dump()});
    }
    if (directions_.empty()) problems.push_back({where_, "no view shows enough of every part"});
  } catch (const std::exception& error) {
    problems.push_back({where_, error.what()});
  }
  views.resize(directions_.size());
}

void Subject::check_surface() const {
  if (flawed_allowed_) return;
  if (const std::string flaws = flaws_of(mesh_->get()); !flaws.empty())
    throw InputError(shape_.mesh.string() + ": " + flaws);
}

void Subject::make(std::size_t view, std::span<const Entry> entries, Store& store) {
  const std::function<Cloud()> input = [&] {
    const auto& [direction, roll] = directions_[view];
    return finite_points(camera::render(mesh_->get(), direction, roll, camera_));
  };
  views[view] = make_parts(input, entries, view < query_views_,
                           key_ + "view " + std::to_string(view) + '\n', store);
}

void Subject::close(std::span<const Entry> entries) {
  mesh_.reset();
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (v < train_views()) labels.insert(views[v].labels.begin(), views[v].labels.end());
    for (auto& failure : failures_of(views[v], entries))
      problems.push_back({where(v), std::move(failure)});
  }
}

std::vector<training::View> Subject::learned_views(const Entry& entry) const {
  std::vector<training::View> learned;
  for (std::size_t v = 0; v < train_views(); ++v)
    if (auto features = features_of(views[v], entry))
      learned.push_back({.cloud = std::move(features->frame.cloud),
                         .descriptors = std::move(features->descriptors),
                         .spectrum = std::move(features->spectrum)});
  return learned;
}

training::Params Subject::training_params(const Entry& entry) const {
  training::Params params = entry.config.training;
  seed_training(seed_, params);
  return params;
}

AppearanceModel Subject::learn_appearance(const Entry& entry, pipeline::Times& ms) const {
  const auto learned = learned_views(entry);
  return timed(ms, "training",
               [&] { return training::learn_appearance(learned, training_params(entry)); });
}

RelationModel Subject::learn_relations(const Entry& entry, pipeline::Times& ms) const {
  auto learned = learned_views(entry);
  std::erase_if(learned, [](const training::View& view) { return !view.spectrum; });
  return timed(ms, "training",
               [&] { return training::learn_relations(learned, training_params(entry)); });
}

double Subject::reference_ms(const Entry& entry) const {
  pipeline::Times ms;
  for (std::size_t v = 0; v < train_views(); ++v) add_feature_times(views[v], entry, ms);
  double sum = 0.0;
  for (const auto& [stage, time] : ms) sum += time;
  return sum;
}

std::string Subject::majority(const Entry& entry) const {
  std::map<std::string, std::int64_t> points;
  for (std::size_t v = 0; v < train_views(); ++v) {
    const Made<source::Frame>& frame = views[v].frames.at(entry.source);
    if (!frame.value) continue;
    const Cloud& cloud = frame.value->cloud;
    for (const std::int32_t label : cloud.label)
      if (label != kNoLabel) ++points[cloud.label_names[static_cast<std::size_t>(label)]];
  }
  const auto most =
      std::ranges::max_element(points, {}, [](const auto& entry) { return entry.second; });
  return most == points.end() ? "" : most->first;
}

}  // namespace cosegraph::evaluation
