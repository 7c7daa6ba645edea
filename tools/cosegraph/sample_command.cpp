#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>

#include "io/cloud_io.hpp"
#include "io/mesh_io.hpp"
#include "sample/sequence.hpp"
#include "sample/shapes.hpp"
#include "tools/cosegraph/commands.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;

struct SampleArguments {
  std::string output;
  std::vector<std::string> kinds;
  int count = 6;
  std::uint64_t seed = 1;
  int frames = 0;  // of a sequence; 0: shapes
  sample::SequenceParams sequence;
};

// Labelled meshes KIND1.off, KIND2.off, ... with their label files.
void write_shapes(sample::Kind kind, const SampleArguments& arguments) {
  for (int i = 0; i < arguments.count; ++i) {
    const std::string name = std::string(to_name(kind)) + std::to_string(i + 1);
    const Mesh mesh = sample::make(kind, arguments.seed + static_cast<std::uint64_t>(i));
    const fs::path file = fs::path(arguments.output) / (name + ".off");
    io::write_off(file, mesh);
    io::write_labels(fs::path(arguments.output) / (name + "_labels.txt"), mesh);
    std::cout << file.string() << '\n';
  }
}

// Labelled frames frame000.ply, ... of the kind's first shape.
void write_sequence(sample::Kind kind, const SampleArguments& arguments) {
  sample::SequenceParams params = arguments.sequence;
  params.frames = arguments.frames;
  params.seed = arguments.seed;
  const std::vector<Cloud> frames = sample::sequence(sample::make(kind, arguments.seed), params);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "frame%03zu.ply", i);
    io::write_cloud(fs::path(arguments.output) / name, finite_points(frames[i]));
    std::cout << (fs::path(arguments.output) / name).string() << '\n';
  }
}

int make_samples(const SampleArguments& arguments) {
  std::error_code error;
  fs::create_directories(arguments.output, error);
  if (error) throw InputError(arguments.output + ": cannot be made: " + error.message());
  std::vector<sample::Kind> kinds;
  for (const auto& name : arguments.kinds) kinds.push_back(from_name<sample::Kind>(name));
  if (kinds.empty() && arguments.frames > 0) kinds.push_back(sample::Kind::watering_can);
  if (kinds.empty())
    for (const auto& [kind, name] : names<sample::Kind>()) kinds.push_back(kind);
  if (arguments.frames > 0 && kinds.size() != 1)
    throw ParameterError("--sequence: choose one --kind");
  for (const sample::Kind kind : kinds)
    arguments.frames > 0 ? write_sequence(kind, arguments) : write_shapes(kind, arguments);
  return 0;
}

// Fields of a Params as options of a command: --start-azimuth for start_azimuth.
void add_fields(CLI::App& command, const Fields& fields,
                const std::vector<std::string>& leave_out) {
  for (const auto& field : fields) {
    if (std::ranges::find(leave_out, field.name) != leave_out.end()) continue;
    std::string option = "--" + field.name;
    std::ranges::replace(option, '_', '-');
    command
        .add_option_function<std::string>(
            option,
            [field, option](const std::string& value) {
              try {
                field.set({value});
              } catch (const ParameterError& error) {
                throw CLI::ValidationError(option, error.what());
              }
            },
            field.doc + (field.unit.empty() ? "" : " [" + field.unit + "]"))
        ->default_str(field.text());
  }
}

}  // namespace

void add_sample_command(CLI::App& app, const Choose& choose) {
  auto* command = app.add_subcommand("sample", "Generates labelled shapes, or a camera's stream");
  auto arguments = std::make_shared<SampleArguments>();
  std::string kinds;
  for (const auto& [kind, name] : names<sample::Kind>())
    kinds += (kinds.empty() ? "" : ", ") + std::string(name);
  command->add_option("-o,--output", arguments->output, "folder")->required();
  command->add_option("--kind", arguments->kinds, "of " + kinds + "; default: all")->delimiter(',');
  command->add_option("--count", arguments->count, "shapes per kind")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "of the first shape; the next one has the next")
      ->capture_default_str();
  command
      ->add_option("--sequence", arguments->frames,
                   "instead of meshes this many labelled frames of a depth camera that moves "
                   "around the shape of --seed")
      ->check(CLI::Range(1, 100000));
  add_fields(*command, describe(arguments->sequence), {"frames", "seed"});
  command->footer(
      "Example:\n  cosegraph sample --kind mug --count 6 -o shapes\n"
      "  cosegraph sample --kind watering_can --sequence 60 -o stream");
  command->callback([=] { choose([=] { return make_samples(*arguments); }); });
}

}  // namespace cosegraph::tools
