// One shape of a category, seen with one seed. Internal to evaluation.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "camera/camera.hpp"
#include "tools/evaluation/benchmark.hpp"
#include "tools/evaluation/store.hpp"
#include "tools/evaluation/views.hpp"

namespace cosegraph::evaluation {

class Subject {
 public:
  Subject(const Shape& shape, std::string fingerprint, const std::string& category,
          std::uint64_t seed, const Protocol& protocol);

  // Chooses the views; without any, and with a problem that says why, it takes no part.
  void open(Store& store);
  // Makes the parts of one view. May be called for several views at once.
  void make(std::size_t view, std::span<const Entry> entries, Store& store);
  // To be called when all views are made: collects `labels` and the problems, frees the mesh.
  void close(std::span<const Entry> entries);

  // As the reference: what is learned of it, and its most frequent label ("" without views).
  // Relations are learned from the views that have a spectrum.
  AppearanceModel learn_appearance(const Entry& entry, pipeline::Times& ms) const;
  RelationModel learn_relations(const Entry& entry, pipeline::Times& ms) const;
  std::string majority(const Entry& entry) const;

  // The times of all that is seen of it as the reference.
  double reference_ms(const Entry& entry) const;

  const std::string& name() const { return shape_.name; }
  const std::string& where() const { return where_; }  // "Cup/21"
  std::string where(std::size_t view) const;           // "Cup/21 view 3"
  std::uint64_t seed() const { return seed_; }

  std::vector<std::string> label_names;  // of the mesh
  std::vector<ViewParts> views;
  std::set<std::string> labels;  // that the training views show
  std::vector<Problem> problems;

 private:
  class LazyMesh;

  void check_surface() const;
  std::size_t train_views() const;
  std::vector<training::View> learned_views(const Entry& entry) const;
  training::Params training_params(const Entry& entry) const;

  Shape shape_;
  std::string where_;
  std::uint64_t seed_;
  camera::Params camera_;
  std::size_t wanted_train_views_;
  std::size_t query_views_;
  bool flawed_allowed_;
  std::string key_;  // of all that its records depend on
  std::vector<camera::View> directions_;
  std::shared_ptr<LazyMesh> mesh_;
};

}  // namespace cosegraph::evaluation
