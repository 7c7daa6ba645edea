#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "sink/sink.hpp"
#include "tools/cosegraph/commands.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;

struct PictureArguments {
  std::vector<std::string> clouds;
  std::string output;
  int columns = 6;
};

// "accuracy 93.1 %" where results.json beside the cloud knows it.
std::string accuracy_of(const fs::path& cloud) {
  const fs::path file = cloud.parent_path() / "results.json";
  if (!fs::exists(file)) return "";
  const auto results = nlohmann::json::parse(io::read_file(file), nullptr, false);
  if (results.is_discarded() || !results.contains("frames")) return "";
  for (const auto& frame : results["frames"]) {
    if (frame["name"] != cloud.stem().string() || !frame.contains("accuracy")) continue;
    char text[32];
    std::snprintf(text, sizeof text, "accuracy %.1f %%", 100 * frame["accuracy"].get<double>());
    return text;
  }
  return "";
}

int draw_clouds(const PictureArguments& arguments) {
  std::vector<Cloud> clouds;
  for (const auto& file : arguments.clouds) clouds.push_back(io::read_cloud(file));
  std::vector<sink::Panel> panels;
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    const fs::path file = arguments.clouds[i];
    const bool labelled = !clouds[i].label.empty();
    panels.push_back({.title = file.stem().string(),
                      .subtitle = accuracy_of(file),
                      .cloud = &clouds[i],
                      .group = labelled ? clouds[i].label
                                        : std::vector<std::int32_t>(clouds[i].size(), kNoLabel),
                      .names = clouds[i].label_names});
  }
  io::write_file(arguments.output, sink::draw_png(panels, {.columns = arguments.columns}));
  return 0;
}

}  // namespace

void add_picture_command(CLI::App& app, const Choose& choose) {
  auto* command = app.add_subcommand("picture", "Draws labelled clouds side by side as a PNG");
  auto arguments = std::make_shared<PictureArguments>();
  command->add_option("cloud", arguments->clouds, "labelled clouds, as segment writes them")
      ->required();
  command->add_option("-o,--output", arguments->output, "PNG file")->required();
  command->add_option("--columns", arguments->columns, "pictures per row")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->footer("Example:\n  cosegraph picture out/frame*.ply -o strip.png --columns 6");
  command->callback([=] { choose([=] { return draw_clouds(*arguments); }); });
}

}  // namespace cosegraph::tools
