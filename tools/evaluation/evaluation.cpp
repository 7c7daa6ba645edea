#include "tools/evaluation/evaluation.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "sink/sink.hpp"
#include "tools/evaluation/block.hpp"
#include "tools/evaluation/forecast.hpp"
#include "tools/evaluation/parallel.hpp"
#include "tools/evaluation/plan.hpp"
#include "tools/evaluation/subject.hpp"

namespace cosegraph::evaluation {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kStoreProblem = "what is kept for a later start";

// A query view and the references that it is compatible with.
struct Query {
  std::size_t subject = 0;
  std::size_t view = 0;
  std::vector<std::size_t> references;

  std::array<int, 2> key() const { return {static_cast<int>(subject), static_cast<int>(view)}; }
};

// Halves of models per subject, as far as they are needed, by the texts that Entry has for them.
template <class Half>
using Learned = std::map<std::string, std::vector<std::optional<Made<Half>>>>;

struct Lessons {
  Learned<AppearanceModel> appearance;
  Learned<RelationModel> relations;
};

using Models = std::vector<std::optional<Made<Model>>>;  // per subject, as far as they are needed

// Both halves for one configuration.
Made<Model> joined(const Made<AppearanceModel>& appearance, const Made<RelationModel>* relations) {
  Made<Model> model{.ms = appearance.ms};
  if (!appearance.value || (relations != nullptr && !relations->value)) {
    model.failure = appearance.value ? relations->failure : appearance.failure;
    return model;
  }
  model.value = Model{.appearance = *appearance.value};
  if (relations == nullptr) return model;
  model.value->relation = *relations->value;
  for (const auto& [stage, time] : relations->ms) model.ms[stage] += time;
  return model;
}

// One configuration's work in one category with one seed.
struct Work {
  const Entry* entry = nullptr;
  int configuration = 0;
  std::string key;
  Block block;
  Clock::time_point saved{};
};

// One category with one seed, by all configurations.
struct Round {
  std::uint64_t seed = 0;
  std::vector<Work> work;

  bool complete() const {
    return std::ranges::all_of(work, [](const Work& w) { return w.block.complete; });
  }
};

struct Job {
  Category category;
  std::vector<std::string> fingerprints;  // per shape
  std::vector<Round> rounds;              // per seed
};

// A labelling without any method: every point of a segment has the segment's label.
Labelling labelling_by(const Segments& segments, std::vector<std::string> names,
                       std::vector<std::int32_t> segment_label) {
  Labelling result{.label_names = std::move(names), .segment_label = std::move(segment_label)};
  for (const std::int32_t segment : segments.of_point)
    result.point_label.push_back(result.segment_label[static_cast<std::size_t>(segment)]);
  result.proven_optimal = true;
  return result;
}

// The most frequent true label in each segment (ties: the first), the first label where it has no
// labelled point.
std::vector<std::int32_t> true_labels(const Cloud& input, const Segments& segments) {
  const std::size_t labels = input.label_names.size();
  std::vector<std::int64_t> count(static_cast<std::size_t>(segments.count) * labels);
  for (std::size_t i = 0; i < input.label.size(); ++i) {
    if (input.dense_index[i] == kNoPoint || input.label[i] == kNoLabel) continue;
    const auto segment = segments.of_point[static_cast<std::size_t>(input.dense_index[i])];
    ++count[static_cast<std::size_t>(segment) * labels + static_cast<std::size_t>(input.label[i])];
  }
  std::vector<std::int32_t> result;
  for (auto row = count.begin(); row != count.end(); row += static_cast<std::ptrdiff_t>(labels))
    result.push_back(static_cast<std::int32_t>(
        std::max_element(row, row + static_cast<std::ptrdiff_t>(labels)) - row));
  return result;
}

// A query view made ready for one configuration.
struct Target {
  const Entry& entry;
  const Cloud& input;  // with the true labels
  const Segments& segments;
  std::optional<pipeline::Features> features;  // of methods
  pipeline::Config config;
};

// What a target is labelled by: a model, and the reference's most frequent label.
struct Teacher {
  const Model* model = nullptr;  // for methods
  std::string majority;
};

Labelling label(const Target& target, const Teacher& teacher, pipeline::Times& ms) {
  if (target.entry.labeller == Labeller::method) {
    Scores scores;
    return pipeline::label(*target.features, target.segments, *teacher.model, target.config, scores,
                           &ms);
  }
  std::vector<std::string> names = target.input.label_names;
  auto at = std::ranges::find(names, teacher.majority);
  if (at == names.end()) at = names.insert(names.end(), teacher.majority);
  const auto majority = static_cast<std::int32_t>(at - names.begin());
  const auto count = static_cast<std::size_t>(target.segments.count);
  Labelling labelling = labelling_by(target.segments, std::move(names),
                                     target.entry.labeller == Labeller::majority
                                         ? std::vector<std::int32_t>(count, majority)
                                         : true_labels(target.input, target.segments));
  labelling.majority = majority;
  return labelling;
}

// Adds one pair to a query's result; `names` are the category's labels.
void add_pair(const Target& target, const Teacher& teacher, const std::vector<std::string>& names,
              Pair pair, pipeline::Times& ms, QueryResult& result) {
  const Labelling labelling = label(target, teacher, ms);
  const Comparison comparison = compare(target.input, labelling, names);
  const auto bounds = sink::evaluate(target.input, target.segments, labelling);
  pair.figures = figures_of(comparison);
  pair.majority_floor = bounds->floor;
  pair.oracle = bounds->oracle;
  pair.expansions = labelling.expansions;
  pair.proven_optimal = labelling.proven_optimal;
  const auto place = positions(labelling.label_names, names);
  for (const std::int32_t label : labelling.segment_label)
    pair.segment_label.push_back(
        static_cast<std::int16_t>(place.at(static_cast<std::size_t>(label))));
  add_to(result.confusion, comparison, names.size());
  result.pairs.push_back(std::move(pair));
}

class Evaluation {
 public:
  Evaluation(const Protocol& protocol, const Progress& progress, const Keep& keep)
      : protocol_(protocol),
        progress_(progress),
        results_(keep.results),
        keep_views_(keep),
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
  // All of these answer false if they were stopped.
  bool evaluate_round(const Job& job, Round& round);
  bool evaluate_round(const Job& job, Round& round, Store& views);
  bool evaluate_work(Work& work, std::vector<Subject>& subjects, const std::vector<Query>& queries,
                     Lessons& lessons);
  bool open(std::vector<Subject>& subjects, Store& store);
  bool make_views(std::vector<Subject>& subjects, std::span<const Entry> entries, Store& store);
  bool learn(const Entry& entry, const std::vector<Subject>& subjects,
             const std::set<std::size_t>& references, Lessons& lessons);

  Job job_of(const std::string& category);
  Work work_of(const Job& job, std::uint64_t seed, std::size_t configuration) const;
  std::vector<Query> queries_of(const std::vector<Subject>& subjects, CategoryCounts& counts) const;
  QueryResult label_view(const Work& work, const std::vector<Subject>& subjects, const Query& query,
                         const Models& models) const;
  void keep(Work& work, bool at_once);
  void add_to_report(Job& job);
  void note(const std::string& where, const std::string& what);  // a problem, once

  // parallel_for that keeps the forecast and shows the progress.
  bool each(Piece piece, const std::string& step, std::size_t count,
            const std::function<void(std::size_t)>& body);
  Status status(const std::string& step) const;
  void expect(const Job& job);
  void expect_instead(Piece piece, std::size_t before, std::size_t now);
  std::size_t view_count() const {
    return static_cast<std::size_t>(std::max(protocol_.query_views, protocol_.train_views));
  }
  std::size_t query_views() const { return static_cast<std::size_t>(protocol_.query_views); }

  const Protocol& protocol_;
  const Progress& progress_;
  Store results_;
  Keep keep_views_;
  std::vector<Entry> entries_;
  std::vector<std::string> names_;
  int jobs_;
  Forecast forecast_;
  std::mutex show_;
  std::mutex keep_;
  Report report_;
  std::string current_;  // category
  std::size_t finished_ = 0;
};

// -- progress ----------------------------------------------------------------------------------

bool Evaluation::each(Piece piece, const std::string& step, std::size_t count,
                      const std::function<void(std::size_t)>& body) {
  return parallel_for(count, jobs_, progress_.stopped, [&](std::size_t i) {
    const auto start = Clock::now();
    body(i);
    const std::chrono::duration<double> spent = Clock::now() - start;
    forecast_.done(piece, spent.count());
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

// What a category will take if every shape has all its views and all are compatible.
void Evaluation::expect(const Job& job) {
  const std::size_t shapes = job.category.shapes.size();
  for (const Round& round : job.rounds) {
    if (round.complete()) continue;
    expect_instead(Piece::shape, 0, shapes);
    expect_instead(Piece::view, 0, shapes * view_count());
    for (const Work& work : round.work) {
      if (work.block.complete) continue;
      expect_instead(Piece::model, 0, shapes);
      expect_instead(Piece::query, work.block.results.size(), shapes * query_views());
    }
  }
}

void Evaluation::expect_instead(Piece piece, std::size_t before, std::size_t now) {
  forecast_.expect(piece, static_cast<long>(now) - static_cast<long>(before));
}

// -- what is kept ------------------------------------------------------------------------------

Work Evaluation::work_of(const Job& job, std::uint64_t seed, std::size_t configuration) const {
  camera::Params camera = protocol_.camera;
  std::string key = "pairs of " + job.category.name + '\n' + entries_[configuration].all + '\n' +
                    recipe(camera::describe(camera)) + '\n';
  for (const auto& number : {seed, static_cast<std::uint64_t>(protocol_.flawed),
                             static_cast<std::uint64_t>(protocol_.query_views),
                             static_cast<std::uint64_t>(protocol_.train_views)})
    key += std::to_string(number) + '\n';
  for (std::size_t s = 0; s < job.category.shapes.size(); ++s)
    key += job.category.shapes[s].name + ' ' + job.fingerprints[s] + '\n';
  Block block = read_block(key, results_);
  return {.entry = &entries_[configuration],
          .configuration = static_cast<int>(configuration),
          .key = std::move(key),
          .block = std::move(block)};
}

Job Evaluation::job_of(const std::string& category) {
  Job job{.category = read_category(protocol_.data, category, report_.problems)};
  auto& shapes = job.category.shapes;
  if (protocol_.shapes > 0 && shapes.size() > static_cast<std::size_t>(protocol_.shapes))
    shapes.resize(static_cast<std::size_t>(protocol_.shapes));
  for (const Shape& shape : shapes) try {
      job.fingerprints.push_back(fingerprint_of(shape.mesh) + fingerprint_of(shape.labels));
    } catch (const InputError&) {
      job.fingerprints.emplace_back();  // whoever reads it will say why
    }
  for (const std::uint64_t seed : protocol_.seeds) {
    Round& round = job.rounds.emplace_back(Round{.seed = seed});
    for (std::size_t c = 0; c < entries_.size(); ++c) round.work.push_back(work_of(job, seed, c));
  }
  return job;
}

// At most once a second, unless `at_once`.
void Evaluation::keep(Work& work, bool at_once) {
  if (!at_once && Clock::now() - work.saved < std::chrono::seconds(1)) return;
  write_block(work.key, work.block, results_);
  work.saved = Clock::now();
}

// -- views -------------------------------------------------------------------------------------

bool Evaluation::open(std::vector<Subject>& subjects, Store& store) {
  return each(Piece::shape, "choice of views", subjects.size(),
              [&](std::size_t s) { subjects[s].open(store); });
}

bool Evaluation::make_views(std::vector<Subject>& subjects, std::span<const Entry> entries,
                            Store& store) {
  std::vector<std::pair<std::size_t, std::size_t>> wanted;
  for (std::size_t s = 0; s < subjects.size(); ++s)
    for (std::size_t v = 0; v < subjects[s].views.size(); ++v) wanted.emplace_back(s, v);
  expect_instead(Piece::view, subjects.size() * view_count(), wanted.size());
  const bool complete = each(Piece::view, "views", wanted.size(), [&](std::size_t i) {
    subjects[wanted[i].first].make(wanted[i].second, entries, store);
  });
  for (Subject& subject : subjects) subject.close(entries);
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

// -- models and pairs --------------------------------------------------------------------------

bool Evaluation::learn(const Entry& entry, const std::vector<Subject>& subjects,
                       const std::set<std::size_t>& references, Lessons& lessons) {
  auto& appearance = lessons.appearance[entry.appearance];
  auto& relations = lessons.relations[entry.relations];
  appearance.resize(subjects.size());
  relations.resize(subjects.size());
  std::vector<std::size_t> missing;
  for (const std::size_t r : references)
    if (!appearance[r] || (!entry.relations.empty() && !relations[r])) missing.push_back(r);
  expect_instead(Piece::model, subjects.size(), missing.size());
  return each(Piece::model, "models, " + entry.name, missing.size(), [&](std::size_t i) {
    const std::size_t r = missing[i];
    const Subject& subject = subjects[r];
    if (!appearance[r])
      appearance[r] =
          make([&](pipeline::Times& ms) { return subject.learn_appearance(entry, ms); });
    if (!entry.relations.empty() && !relations[r])
      relations[r] = make([&](pipeline::Times& ms) { return subject.learn_relations(entry, ms); });
  });
}

// Views and references that failed are passed over: they are reported where they failed.
QueryResult Evaluation::label_view(const Work& work, const std::vector<Subject>& subjects,
                                   const Query& query, const Models& models) const {
  const Entry& entry = *work.entry;
  const Subject& subject = subjects[query.subject];
  const ViewParts& parts = subject.views[query.view];
  const bool with_model = entry.labeller == Labeller::method;
  const Made<source::Frame>& frame = parts.frames.at(entry.source);
  if (!frame.value || !parts.segments.at(entry.segments).value) return {};
  Target target{.entry = entry,
                .input = frame.value->input,
                .segments = *parts.segments.at(entry.segments).value,
                .config = entry.config};
  if (with_model) target.features = features_of(parts, entry);
  if (with_model && !target.features) return {};
  if (!entry.spectra.empty() && !target.features->spectrum) return {};
  seed_query(subject.seed(), static_cast<int>(query.view), target.config.fisher);
  QueryResult result;
  for (const std::size_t r : query.references) {
    if (with_model && !models[r]->value) continue;
    pipeline::Times ms;
    add_times(parts, entry, ms);
    Teacher teacher;
    if (with_model) {
      teacher.model = &*models[r]->value;
      ms.insert(models[r]->ms.begin(), models[r]->ms.end());
    } else {
      teacher.majority = subjects[r].majority(entry);
    }
    try {
      add_pair(target, teacher, work.block.counts.label_names,
               {.reference = subjects[r].name(),
                .query = subject.name(),
                .view = static_cast<int>(query.view)},
               ms, result);
      for (std::size_t s = 0; s < kStages.size(); ++s)
        result.pairs.back().ms[s] = ms[std::string(kStages[s])];
    } catch (const std::exception& error) {
      result.problems.push_back({subject.where(query.view), "after " + subjects[r].name() + ", " +
                                                                entry.name + ": " + error.what()});
    }
  }
  return result;
}

bool Evaluation::evaluate_work(Work& work, std::vector<Subject>& subjects,
                               const std::vector<Query>& queries, Lessons& lessons) {
  const Entry& entry = *work.entry;
  Block& block = work.block;
  std::vector<const Query*> left;
  std::set<std::size_t> references;
  for (const Query& query : queries)
    if (!block.results.contains(query.key())) {
      left.push_back(&query);
      references.insert(query.references.begin(), query.references.end());
    }
  if (entry.labeller != Labeller::method) references.clear();
  expect_instead(Piece::query, subjects.size() * query_views() - block.results.size(), left.size());
  if (!learn(entry, subjects, references, lessons)) return false;
  Models models(subjects.size());
  for (const std::size_t r : references) {
    const bool alone = entry.relations.empty();
    models[r] = joined(*lessons.appearance[entry.appearance][r],
                       alone ? nullptr : &*lessons.relations[entry.relations][r]);
    models[r]->ms["reference"] = subjects[r].reference_ms(entry);
    if (models[r]->value) continue;
    const Problem problem{subjects[r].where(),
                          "as the reference, " + entry.name + ": " + models[r]->failure};
    if (std::ranges::find(block.problems, problem) == block.problems.end())
      block.problems.push_back(problem);
  }
  block.complete = each(Piece::query, "labels, " + entry.name, left.size(), [&](std::size_t i) {
    QueryResult result = label_view(work, subjects, *left[i], models);
    const std::lock_guard lock(keep_);
    block.results[left[i]->key()] = std::move(result);
    keep(work, false);
  });
  keep(work, true);
  return block.complete;
}

// -- the whole ---------------------------------------------------------------------------------

// By every configuration that is not complete; those that learn alike share what they learned.
bool Evaluation::evaluate_round(const Job& job, Round& round, Store& views) {
  std::vector<Subject> subjects;
  for (std::size_t s = 0; s < job.category.shapes.size(); ++s)
    subjects.emplace_back(job.category.shapes[s], job.fingerprints[s], job.category.name,
                          round.seed, protocol_);
  std::vector<Entry> wanted;
  for (const Work& work : round.work)
    if (!work.block.complete) wanted.push_back(*work.entry);
  if (!open(subjects, views) || !make_views(subjects, wanted, views)) return false;

  CategoryCounts counts{.name = job.category.name};
  std::set<std::string> names;
  std::vector<Problem> problems;
  for (const Subject& subject : subjects) {
    names.insert(subject.label_names.begin(), subject.label_names.end());
    problems.insert(problems.end(), subject.problems.begin(), subject.problems.end());
  }
  counts.label_names.assign(names.begin(), names.end());
  const std::vector<Query> queries = queries_of(subjects, counts);
  if (queries.empty()) problems.push_back({counts.name, "no two shapes make a compatible pair"});

  Lessons lessons;
  for (Work& work : round.work) {
    if (work.block.complete) continue;
    work.block.counts = counts;
    for (const Problem& problem : problems)
      if (std::ranges::find(work.block.problems, problem) == work.block.problems.end())
        work.block.problems.push_back(problem);
    if (!evaluate_work(work, subjects, queries, lessons)) return false;
  }
  return true;
}

void Evaluation::note(const std::string& where, const std::string& what) {
  const Problem problem{where, what};
  if (std::ranges::find(report_.problems, problem) == report_.problems.end())
    report_.problems.push_back(problem);
}

bool Evaluation::evaluate_round(const Job& job, Round& round) {
  if (round.complete()) return true;
  std::filesystem::path folder = keep_views_.views;
  if (!folder.empty() && !keep_views_.views_after)
    folder /= job.category.name + " seed " + std::to_string(round.seed);
  Store views(folder);
  if (!evaluate_round(job, round, views)) return false;
  if (const std::string failure = views.failure(); !failure.empty()) note(kStoreProblem, failure);
  std::error_code error;
  if (keep_views_.views_after || folder.empty()) return true;
  std::filesystem::remove_all(folder, error);
  std::filesystem::remove(keep_views_.views, error);  // if nothing else is in it
  return true;
}

void Evaluation::add_to_report(Job& job) {
  const int category = static_cast<int>(report_.categories.size());
  CategoryCounts counts = job.rounds[0].work[0].block.counts;
  counts.compatible = counts.incompatible = 0;
  std::vector<Confusion> confusions(entries_.size());
  std::vector<Problem> problems;
  for (Round& round : job.rounds) {
    counts.compatible += round.work[0].block.counts.compatible;
    counts.incompatible += round.work[0].block.counts.incompatible;
    for (Work& work : round.work) {
      const auto add_problem = [&](const Problem& problem) {
        if (std::ranges::find(problems, problem) == problems.end()) problems.push_back(problem);
      };
      std::ranges::for_each(work.block.problems, add_problem);
      Confusion& confusion = confusions[static_cast<std::size_t>(work.configuration)];
      confusion.configuration = work.configuration;
      confusion.category = category;
      confusion.fraction.resize(counts.label_names.size() * counts.label_names.size());
      for (auto& [query, result] : work.block.results) {
        std::ranges::for_each(result.problems, add_problem);
        for (std::size_t i = 0; i < result.confusion.size(); ++i)
          confusion.fraction[i] += result.confusion[i];
        for (Pair& pair : result.pairs) {
          pair.configuration = work.configuration;
          pair.category = category;
          pair.seed = round.seed;
          report_.pairs.push_back(std::move(pair));
        }
      }
      work.block = {};
    }
  }
  report_.categories.push_back(std::move(counts));
  std::ranges::move(confusions, std::back_inserter(report_.confusions));
  std::ranges::move(problems, std::back_inserter(report_.problems));
}

Report Evaluation::run() {
  std::vector<Job> jobs;
  for (const auto& name : names_) {
    jobs.push_back(job_of(name));
    expect(jobs.back());
  }
  for (Job& job : jobs) {
    current_ = job.category.name;
    for (Round& round : job.rounds)
      if (!evaluate_round(job, round)) {
        report_.interrupted = true;
        return std::move(report_);
      }
    ++finished_;
    add_to_report(job);
    if (progress_.category_done) progress_.category_done(report_, status("done"));
  }
  if (const std::string failure = results_.failure(); !failure.empty())
    note(kStoreProblem, failure);
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

Report evaluate(const Protocol& protocol, const Progress& progress, const Keep& keep) {
  check(protocol);
  return Evaluation(protocol, progress, keep).run();
}

}  // namespace cosegraph::evaluation
