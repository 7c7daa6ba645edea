#include "tools/evaluation/evaluation.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "inputs/inputs.hpp"
#include "sink/sink.hpp"
#include "tools/evaluation/forecast.hpp"
#include "tools/evaluation/parallel.hpp"
#include "tools/evaluation/plan.hpp"
#include "tools/evaluation/views.hpp"

namespace cosegraph::evaluation {
namespace {

// One shape of the category at work. Without views it takes no part.
struct Subject {
  Shape shape;
  std::uint64_t seed = 0;
  Mesh mesh;  // until its views are made
  camera::Params camera;
  std::vector<camera::View> directions;
  std::vector<ViewParts> views;
  std::set<std::string> labels;  // what it teaches as a reference
  std::vector<Problem> problems;
};

// A query view and the references that it is compatible with.
struct Query {
  std::size_t subject = 0;
  std::size_t view = 0;
  std::vector<std::size_t> references;
};

std::vector<std::size_t> references_of(const std::vector<Query>& queries) {
  std::set<std::size_t> references;
  for (const Query& query : queries)
    references.insert(query.references.begin(), query.references.end());
  return {references.begin(), references.end()};
}

using Models = std::vector<Made<Model>>;  // per subject; those without a compatible query: nothing

// A query view made ready for one configuration.
struct Target {
  const Cloud& input;  // with the true labels
  const pipeline::Features& features;
  const Segments& segments;
  pipeline::Config config;
};

std::string in_words(std::size_t view) {
  return " view " + std::to_string(view);
}

class Evaluation {
 public:
  Evaluation(const Protocol& protocol, const Progress& progress)
      : protocol_(protocol),
        progress_(progress),
        entries_(entries_of(protocol)),
        names_(choose_categories(protocol.data, protocol.categories)),
        jobs_(protocol.jobs > 0
                  ? protocol.jobs
                  : std::max(1, static_cast<int>(std::thread::hardware_concurrency()))),
        forecast_(jobs_) {
    report_.protocol = protocol;
    report_.configurations = protocol.configurations;
  }

  Report run();

 private:
  // What one category adds to the report.
  struct Outcome {
    CategoryCounts counts;
    std::vector<Pair> pairs;
    std::vector<Problem> problems;
  };

  // All of these answer false if they were stopped.
  bool evaluate_category(const Category& category, Outcome& outcome);
  bool evaluate_pairs(const std::vector<Subject>& subjects, const std::vector<Query>& queries,
                      Outcome& outcome);
  bool choose_views(std::vector<Subject>& subjects);
  bool make_views(std::vector<Subject>& subjects);
  bool train(const Entry& entry, const std::vector<Subject>& subjects,
             const std::vector<std::size_t>& references, Models& models);
  bool label(std::size_t configuration, const std::vector<Subject>& subjects,
             const std::vector<Query>& queries, const Models& models, Outcome& outcome);

  void open(const std::string& category, Subject& subject) const;
  std::vector<Query> queries_of(const std::vector<Subject>& subjects, CategoryCounts& counts) const;
  Model train_one(const Entry& entry, const Subject& subject, pipeline::Times& ms) const;
  Pair label_pair(const Target& target, const Model& model, pipeline::Times& ms) const;
  void label_view(std::size_t configuration, const std::vector<Subject>& subjects,
                  const Query& query, const Models& models, Outcome& outcome) const;

  // parallel_for that keeps the forecast and shows the progress.
  bool each(Work kind, const std::string& step, std::size_t count,
            const std::function<void(std::size_t)>& body);
  Status status(const std::string& step) const;
  void expect(const std::vector<Category>& categories);
  void expect_instead(Work kind, std::size_t before, std::size_t now);
  std::size_t view_count() const {
    return static_cast<std::size_t>(std::max(protocol_.query_views, protocol_.train_views));
  }
  std::size_t query_views() const { return static_cast<std::size_t>(protocol_.query_views); }
  std::size_t train_views() const { return static_cast<std::size_t>(protocol_.train_views); }

  const Protocol& protocol_;
  const Progress& progress_;
  std::vector<Entry> entries_;
  std::vector<std::string> names_;
  int jobs_;
  Forecast forecast_;
  std::mutex show_;
  Report report_;
  std::string current_;  // category
  std::size_t finished_ = 0;
};

// -- progress ----------------------------------------------------------------------------------

bool Evaluation::each(Work kind, const std::string& step, std::size_t count,
                      const std::function<void(std::size_t)>& body) {
  return parallel_for(count, jobs_, progress_.stopped, [&](std::size_t i) {
    const auto start = std::chrono::steady_clock::now();
    body(i);
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    forecast_.done(kind, spent.count());
    if (!progress_.step) return;
    const std::lock_guard lock(show_);
    progress_.step(status(step));
  });
}

Status Evaluation::status(const std::string& step) const {
  return {.category = current_,
          .categories_done = finished_,
          .categories = names_.size(),
          .step = step,
          .done = forecast_.fraction(),
          .seconds_left = forecast_.seconds_left()};
}

// What all categories will take if every shape has all its views and all are compatible.
void Evaluation::expect(const std::vector<Category>& categories) {
  for (const Category& category : categories) {
    const auto shapes = static_cast<long>(category.shapes.size());
    const auto configurations = static_cast<long>(entries_.size());
    forecast_.expect(Work::shape, shapes);
    forecast_.expect(Work::view, shapes * static_cast<long>(view_count()));
    forecast_.expect(Work::model, shapes * configurations);
    forecast_.expect(Work::query, shapes * protocol_.query_views * configurations);
  }
}

void Evaluation::expect_instead(Work kind, std::size_t before, std::size_t now) {
  forecast_.expect(kind, static_cast<long>(now) - static_cast<long>(before));
}

// -- shapes and views --------------------------------------------------------------------------

void Evaluation::open(const std::string& category, Subject& subject) const {
  const std::string where = category + "/" + subject.shape.name;
  try {
    subject.mesh = inputs::read_labelled_mesh(subject.shape.mesh, subject.shape.labels);
    subject.camera = protocol_.camera;
    subject.camera.count = static_cast<int>(view_count());
    subject.camera.seed = camera_seed(subject.seed);
    subject.directions = camera::choose_views(subject.mesh, subject.camera);
    if (subject.directions.empty())
      subject.problems.push_back({where, "no view shows enough of every part"});
  } catch (const std::exception& error) {
    subject.directions.clear();
    subject.problems.push_back({where, error.what()});
  }
}

bool Evaluation::choose_views(std::vector<Subject>& subjects) {
  return each(Work::shape, "choice of views", subjects.size(),
              [&](std::size_t s) { open(current_, subjects[s]); });
}

bool Evaluation::make_views(std::vector<Subject>& subjects) {
  std::vector<std::pair<std::size_t, std::size_t>> wanted;
  for (std::size_t s = 0; s < subjects.size(); ++s) {
    subjects[s].views.resize(subjects[s].directions.size());
    for (std::size_t v = 0; v < subjects[s].views.size(); ++v) wanted.emplace_back(s, v);
  }
  expect_instead(Work::view, subjects.size() * view_count(), wanted.size());
  const bool complete = each(Work::view, "views", wanted.size(), [&](std::size_t i) {
    Subject& subject = subjects[wanted[i].first];
    const std::size_t v = wanted[i].second;
    const camera::View& view = subject.directions[v];
    const Cloud input =
        finite_points(camera::render(subject.mesh, view.direction, view.roll, subject.camera));
    subject.views[v] = make_parts(input, entries_, v < query_views());
  });
  for (Subject& subject : subjects) {
    subject.mesh = {};
    for (std::size_t v = 0; v < subject.views.size(); ++v) {
      if (v < train_views()) subject.labels.merge(std::set(subject.views[v].labels));
      for (auto& failure : failures_of(subject.views[v], entries_))
        subject.problems.push_back(
            {current_ + "/" + subject.shape.name + in_words(v), std::move(failure)});
    }
  }
  return complete;
}

std::vector<Query> Evaluation::queries_of(const std::vector<Subject>& subjects,
                                          CategoryCounts& counts) const {
  std::vector<Query> queries;
  for (std::size_t q = 0; q < subjects.size(); ++q)
    for (std::size_t v = 0; v < std::min(subjects[q].views.size(), query_views()); ++v) {
      Query query{.subject = q, .view = v};
      for (std::size_t r = 0; r < subjects.size(); ++r) {
        if (r == q || subjects[r].views.empty()) continue;
        if (std::ranges::includes(subjects[r].labels, subjects[q].views[v].labels))
          query.references.push_back(r);
        else
          ++counts.incompatible;
      }
      counts.compatible += static_cast<std::int64_t>(query.references.size());
      if (!query.references.empty()) queries.push_back(std::move(query));
    }
  return queries;
}

// -- models ------------------------------------------------------------------------------------

Model Evaluation::train_one(const Entry& entry, const Subject& subject, pipeline::Times& ms) const {
  std::vector<training::View> views;
  for (std::size_t v = 0; v < std::min(subject.views.size(), train_views()); ++v)
    if (auto features = features_of(subject.views[v], entry))
      views.push_back({.cloud = std::move(features->frame.cloud),
                       .descriptors = std::move(features->descriptors),
                       .spectrum = std::move(features->spectrum)});
  training::Params params = entry.config.training;
  seed_training(subject.seed, params);
  return timed(ms, "training", [&] { return training::train(views, params); });
}

bool Evaluation::train(const Entry& entry, const std::vector<Subject>& subjects,
                       const std::vector<std::size_t>& references, Models& models) {
  models.resize(subjects.size());
  return each(Work::model, "models, " + entry.name, references.size(), [&](std::size_t i) {
    const Subject& subject = subjects[references[i]];
    models[references[i]] =
        make([&](pipeline::Times& ms) { return train_one(entry, subject, ms); });
  });
}

// -- pairs -------------------------------------------------------------------------------------

Pair Evaluation::label_pair(const Target& target, const Model& model, pipeline::Times& ms) const {
  Scores scores;
  const Labelling labelling =
      pipeline::label(target.features, target.segments, model, target.config, scores, &ms);
  const auto figures = sink::evaluate(target.input, target.segments, labelling);
  if (!figures) throw InputError("no point has both a true label and a segment");
  return {.accuracy = figures->accuracy,
          .majority_floor = figures->floor,
          .oracle = figures->oracle,
          .segments = target.segments.count,
          .expansions = labelling.expansions,
          .proven_optimal = labelling.proven_optimal};
}

// Views and references that failed are passed over: they are reported where they failed.
void Evaluation::label_view(std::size_t configuration, const std::vector<Subject>& subjects,
                            const Query& query, const Models& models, Outcome& outcome) const {
  const Entry& entry = entries_[configuration];
  const Subject& subject = subjects[query.subject];
  const ViewParts& parts = subject.views[query.view];
  const auto features = features_of(parts, entry);
  if (!features || !parts.segments.at(entry.segments).value) return;
  Target target{.input = parts.frames.at(entry.source).value->input,
                .features = *features,
                .segments = *parts.segments.at(entry.segments).value,
                .config = entry.config};
  seed_query(subject.seed, static_cast<int>(query.view), target.config.fisher);
  for (const std::size_t r : query.references) {
    if (!models[r].value) continue;
    const std::string& reference = subjects[r].shape.name;
    Made<Pair> made =
        make([&](pipeline::Times& ms) { return label_pair(target, *models[r].value, ms); });
    if (!made.value) {
      outcome.problems.push_back({current_ + "/" + subject.shape.name + in_words(query.view),
                                  "after " + reference + ", " + entry.name + ": " + made.failure});
      continue;
    }
    Pair& pair = *made.value;
    pair.configuration = static_cast<int>(configuration);
    pair.category = static_cast<int>(report_.categories.size());
    pair.reference = reference;
    pair.query = subject.shape.name;
    pair.view = static_cast<int>(query.view);
    made.ms.insert(models[r].ms.begin(), models[r].ms.end());
    add_times(parts, entry, made.ms);
    for (std::size_t s = 0; s < kStages.size(); ++s) pair.ms[s] = made.ms[std::string(kStages[s])];
    outcome.pairs.push_back(std::move(pair));
  }
}

bool Evaluation::label(std::size_t configuration, const std::vector<Subject>& subjects,
                       const std::vector<Query>& queries, const Models& models, Outcome& outcome) {
  std::vector<Outcome> parts(queries.size());
  const bool complete = each(
      Work::query, "labels, " + entries_[configuration].name, queries.size(),
      [&](std::size_t i) { label_view(configuration, subjects, queries[i], models, parts[i]); });
  for (Outcome& part : parts) {
    std::ranges::move(part.pairs, std::back_inserter(outcome.pairs));
    std::ranges::move(part.problems, std::back_inserter(outcome.problems));
  }
  return complete;
}

// -- the whole ---------------------------------------------------------------------------------

// Models and labels by every configuration; configurations that are trained alike share models.
bool Evaluation::evaluate_pairs(const std::vector<Subject>& subjects,
                                const std::vector<Query>& queries, Outcome& outcome) {
  const std::vector<std::size_t> references = references_of(queries);
  std::map<std::string, Models> models;
  for (const Entry& entry : entries_) models[entry.training];
  expect_instead(Work::query, subjects.size() * query_views() * entries_.size(),
                 queries.size() * entries_.size());
  expect_instead(Work::model, subjects.size() * entries_.size(), references.size() * models.size());
  for (std::size_t c = 0; c < entries_.size(); ++c) {
    const Entry& entry = entries_[c];
    Models& trained = models[entry.training];
    if (trained.empty()) {
      if (!train(entry, subjects, references, trained)) return false;
      for (const std::size_t r : references)
        if (!trained[r].value)
          outcome.problems.push_back(
              {current_ + "/" + subjects[r].shape.name,
               "as the reference, " + entry.name + ": " + trained[r].failure});
    }
    if (!label(c, subjects, queries, trained, outcome)) return false;
  }
  return true;
}

bool Evaluation::evaluate_category(const Category& category, Outcome& outcome) {
  outcome.counts.name = category.name;
  std::vector<Subject> subjects;
  for (const Shape& shape : category.shapes)
    subjects.push_back(
        {.shape = shape, .seed = shape_seed(protocol_.seed, category.name, shape.name)});
  if (!choose_views(subjects) || !make_views(subjects)) return false;
  for (Subject& subject : subjects)
    std::ranges::move(subject.problems, std::back_inserter(outcome.problems));
  const std::vector<Query> queries = queries_of(subjects, outcome.counts);
  if (queries.empty())
    outcome.problems.push_back({category.name, "no two shapes make a compatible pair"});
  return evaluate_pairs(subjects, queries, outcome);
}

Report Evaluation::run() {
  std::vector<Category> categories;
  for (const auto& name : names_) {
    Category category = read_category(protocol_.data, name, report_.problems);
    if (protocol_.shapes > 0 && category.shapes.size() > static_cast<std::size_t>(protocol_.shapes))
      category.shapes.resize(static_cast<std::size_t>(protocol_.shapes));
    categories.push_back(std::move(category));
  }
  expect(categories);
  for (const Category& category : categories) {
    current_ = category.name;
    Outcome outcome;
    if (!evaluate_category(category, outcome)) {
      report_.interrupted = true;
      return std::move(report_);
    }
    ++finished_;
    report_.categories.push_back(std::move(outcome.counts));
    std::ranges::move(outcome.pairs, std::back_inserter(report_.pairs));
    std::ranges::move(outcome.problems, std::back_inserter(report_.problems));
    if (progress_.category_done) progress_.category_done(report_, status("done"));
  }
  if (report_.pairs.empty()) {
    std::string why = protocol_.data.string() + ": nothing could be evaluated";
    for (const Problem& problem : report_.problems)
      why += "\n  " + problem.where + ": " + problem.what;
    throw InputError(why);
  }
  return std::move(report_);
}

}  // namespace

void check(const Protocol& protocol) {
  check_numbers(protocol);
  entries_of(protocol);
  choose_categories(protocol.data, protocol.categories);
}

Report evaluate(const Protocol& protocol, const Progress& progress) {
  check(protocol);
  return Evaluation(protocol, progress).run();
}

}  // namespace cosegraph::evaluation
