// The commands of the main job: thin wrappers over the graphs in config/graphs.
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "camera/camera.hpp"
#include "inputs/inputs.hpp"
#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "io/mesh_io.hpp"
#include "model/model.hpp"
#include "pipeline/pipeline.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/run_graph.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": cannot be made: " + error.message());
}

// -- view -----------------------------------------------------------------------------------------

struct ViewArguments {
  std::string mesh;
  std::string labels;
  std::string output;
  camera::Params camera;
};

int view(const ViewArguments& arguments) {
  const Mesh mesh = inputs::read_labelled_mesh(arguments.mesh, arguments.labels);
  const std::vector<camera::View> views = camera::choose_views(mesh, arguments.camera);
  if (views.empty()) throw InputError(arguments.mesh + ": no view shows enough of every part");
  make_folder(arguments.output);
  const std::string stem = fs::path(arguments.mesh).stem().string();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Cloud cloud = camera::render(mesh, views[i].direction, views[i].roll, arguments.camera);
    const fs::path file =
        fs::path(arguments.output) / (stem + "-view" + std::to_string(i) + ".ply");
    io::write_cloud(file, finite_points(cloud));
    std::cout << file.string() << '\n';
  }
  if (views.size() < static_cast<std::size_t>(arguments.camera.count))
    std::cerr << arguments.mesh << ": only " << views.size() << " views show every part\n";
  return 0;
}

// -- train ----------------------------------------------------------------------------------------

struct TrainArguments {
  std::string reference;
  std::string labels;
  std::string config = "fpfh+fv+iso";
  std::string output;
  std::vector<std::string> params;
  bool json = false;
  bool processes = false;
};

// Takes the spectra stage, and what hangs on it, out of a graph.
void remove_spectra(graph::GraphDescription& graph) {
  std::erase_if(graph.stages, [](const auto& stage) { return stage.use == "spectra"; });
  for (auto& stage : graph.stages)
    std::erase_if(stage.inputs, [&](const graph::Connection& input) {
      return graph.stage(input.from_stage) == nullptr;
    });
}

int train(const TrainArguments& arguments) {
  pipeline::Config config = pipeline::config_from_name(arguments.config);
  graph::GraphDescription graph =
      graph::load(shipped_graph("train"), graph::catalog_of(stage_table()));
  if (!config.with_spectra) remove_spectra(graph);
  graph::set_param(graph, "source", "path", {arguments.reference});
  if (!arguments.labels.empty()) graph::set_param(graph, "source", "labels", {arguments.labels});
  graph::set_param(graph, "training", "file", {arguments.output});
  configure(graph, "source", describe(config.source));
  configure(graph, "descriptors", describe(config.descriptors));
  configure(graph, "spectra", describe(config.spectra));
  configure(graph, "training", describe(config.training));
  const graph::RunReport report = run_and_report(
      std::move(graph), arguments.params, {.one_process = !arguments.processes}, arguments.json);
  if (report.fine()) std::cerr << "model written to " << arguments.output << '\n';
  return report.fine() ? 0 : 1;
}

// -- segment --------------------------------------------------------------------------------------

struct SegmentArguments {
  std::string model;
  std::vector<std::string> queries;
  std::string output;
  std::string config;
  std::string reference;
  std::vector<std::string> params;
  int window = 4;
  bool picture = false;
  bool json = false;
  bool processes = false;
};

// What the query's stages need to know: named by --config, or as the model was trained.
pipeline::Config query_config(const SegmentArguments& arguments, const Model& model) {
  pipeline::Config config;
  config.astar.spatial = astar::Spatial::iso;
  if (!arguments.config.empty()) config = pipeline::config_from_name(arguments.config);
  try {
    pipeline::adopt_model(model, config);
  } catch (const ParameterError& error) {
    throw MismatchError(arguments.model +
                        ": made by another version of cosegraph: " + error.what());
  }
  if (arguments.config.empty()) return config;
  // A configuration given by name must be one that this model can serve.
  const pipeline::Config named = pipeline::config_from_name(arguments.config);
  const auto differ = [&](const std::string& what, const std::string& wanted,
                          const std::string& trained) {
    if (wanted != trained)
      throw MismatchError(arguments.model + ": the model's " + what + " are '" + trained +
                          "', --config " + arguments.config + " needs '" + wanted + "'");
  };
  pipeline::Config wanted = named;
  differ("descriptors", descriptors::recipe_of(wanted.descriptors),
         model.appearance.descriptor_recipe);
  differ("encodings", recipe(describe(wanted.training.encoding)), model.appearance.encoding_recipe);
  if (named.with_spectra && model.relation.spectrum_recipe.empty())
    throw MismatchError(arguments.model + ": the model has no spatial relations, --config " +
                        arguments.config + " needs them");
  return config;
}

void print_results(const fs::path& folder) {
  const auto results = nlohmann::json::parse(io::read_file(folder / "results.json"));
  for (const auto& frame : results["frames"]) {
    std::printf("%-24s %4d segments", frame["name"].get<std::string>().c_str(),
                frame["segments"].get<int>());
    if (frame.contains("accuracy"))
      std::printf("  accuracy %5.1f %%  majority floor %5.1f %%  oracle %5.1f %%",
                  100 * frame["accuracy"].get<double>(),
                  100 * frame["majority_floor"].get<double>(), 100 * frame["oracle"].get<double>());
    if (!frame["proven_optimal"].get<bool>())
      std::printf("  not proven optimal, gap at most %.3g", frame["gap"].get<double>());
    if (frame.contains("unknown_labels"))
      for (const auto& label : frame["unknown_labels"])
        std::printf("  (the model does not know '%s')", label.get<std::string>().c_str());
    std::printf("\n");
    for (const auto& note : frame["notes"])
      std::printf("    %s\n", note.get<std::string>().c_str());
  }
  if (results.contains("mean"))
    std::printf("mean of %d frames: accuracy %.1f %%, majority floor %.1f %%, oracle %.1f %%\n",
                results["mean"]["frames"].get<int>(),
                100 * results["mean"]["accuracy"].get<double>(),
                100 * results["mean"]["majority_floor"].get<double>(),
                100 * results["mean"]["oracle"].get<double>());
}

int segment(const SegmentArguments& arguments) {
  const Model model = model::from_bytes(io::read_file(arguments.model), arguments.model);
  pipeline::Config config = query_config(arguments, model);
  graph::GraphDescription graph =
      graph::load(shipped_graph("segment"), graph::catalog_of(stage_table()));
  graph.window = arguments.window;
  if (!config.with_spectra) remove_spectra(graph);
  graph::set_param(graph, "model", "file", {arguments.model});
  graph::set_param(graph, "source", "path", arguments.queries);
  graph::set_param(graph, "sink", "folder", {arguments.output});
  if (arguments.picture) graph::set_param(graph, "sink", "picture", {"true"});
  if (!arguments.reference.empty())
    graph::set_param(graph, "sink", "reference", {arguments.reference});
  graph::set_param(graph, "astar", "spatial", {std::string(to_name(config.astar.spatial))});
  configure(graph, "source", describe(config.source));
  configure(graph, "cpc", describe(config.cpc));
  configure(graph, "descriptors", describe(config.descriptors));
  configure(graph, "spectra", describe(config.spectra));
  configure(graph, "astar", describe(config.astar));
  const graph::RunReport report = run_and_report(
      std::move(graph), arguments.params, {.one_process = !arguments.processes}, arguments.json);
  if (!arguments.json) print_results(arguments.output);
  return report.fine() ? 0 : 1;
}

}  // namespace

void add_job_commands(CLI::App& app, const Choose& choose) {
  auto* view_command = app.add_subcommand("view", "Single views of a mesh, as labelled clouds");
  auto views = std::make_shared<ViewArguments>();
  view_command->add_option("mesh", views->mesh, "OFF or PLY mesh")->required();
  view_command->add_option("--labels", views->labels,
                           "benchmark label file; default NAME_labels.txt beside the mesh");
  view_command->add_option("--count", views->camera.count, "how many views")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  view_command->add_option("--seed", views->camera.seed, "of the choice of views")
      ->capture_default_str();
  view_command->add_option("-o,--output", views->output, "folder")->required();
  view_command->footer("Example:\n  cosegraph view shapes/mug1.off --count 8 -o views");
  view_command->callback([=] { choose([=] { return view(*views); }); });

  auto* train_command = app.add_subcommand("train", "Learns a model from one labelled reference");
  auto training = std::make_shared<TrainArguments>();
  train_command
      ->add_option("--reference", training->reference,
                   "labelled mesh, or folder of labelled single-view clouds")
      ->required();
  train_command->add_option("--labels", training->labels,
                            "benchmark label file; default NAME_labels.txt beside the mesh");
  train_command->add_option("--config", training->config, "configuration, as fpfh+fv+iso or best")
      ->capture_default_str();
  train_command->add_option("-o,--output", training->output, "model file")->required();
  train_command
      ->add_option("--param", training->params,
                   "STAGE.NAME=VALUE, may be repeated; see 'cosegraph stages'")
      ->take_all();
  train_command->add_flag("--json", training->json, "the report as JSON");
  train_command->add_flag("--processes", training->processes, "one process per stage");
  train_command->footer("Example:\n  cosegraph train --reference shapes/mug1.off -o mug.coseg");
  train_command->callback([=] { choose([=] { return train(*training); }); });

  auto* segment_command = app.add_subcommand("segment", "Labels query clouds with a model");
  auto job = std::make_shared<SegmentArguments>();
  segment_command->add_option("--model", job->model, "model file")->required();
  segment_command->add_option("query", job->queries, "clouds, meshes, or folders of them")
      ->required();
  segment_command->add_option("-o,--output", job->output, "folder for the results")->required();
  segment_command->add_option("--config", job->config,
                              "configuration; default: what the model was trained for");
  segment_command->add_flag("--picture", job->picture, "a PNG per query");
  segment_command->add_option("--reference", job->reference,
                              "labelled cloud shown beside the query in the pictures");
  segment_command
      ->add_option("--param", job->params,
                   "STAGE.NAME=VALUE, may be repeated; see 'cosegraph stages'")
      ->take_all();
  segment_command->add_option("--window", job->window, "frames in flight, at most")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  segment_command->add_flag("--json", job->json,
                            "the report as JSON; figures per query are in results.json");
  segment_command->add_flag("--processes", job->processes, "one process per stage");
  segment_command->footer(
      "Example:\n  cosegraph segment --model mug.coseg shapes/mug2.off -o out --picture");
  segment_command->callback([=] { choose([=] { return segment(*job); }); });
}

}  // namespace cosegraph::tools
