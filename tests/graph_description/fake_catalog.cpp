#include "graph_description/fake_catalog.hpp"

template <>
cosegraph::Names<cosegraph::graph::test::Mode> cosegraph::names<cosegraph::graph::test::Mode>() {
  using cosegraph::graph::test::Mode;
  static constexpr std::pair<Mode, std::string_view> table[] = {{Mode::exact, "exact"},
                                                                {Mode::greedy, "greedy"}};
  return table;
}

namespace cosegraph::graph::test {

Fields describe(FakeParams& params) {
  const auto check_channel = [](const std::string& channel) {
    if (channel.find(':') == std::string::npos)
      throw ParameterError("'" + channel + "' is not of the form KIND:RADIUS");
  };
  return {boolean_field("loop", params.loop, "Start again at the end."),
          integer_field("threads", params.threads, 0, 256, "", "Threads; 0 takes all cores."),
          seed_field("seed", params.seed, "Seed of all that is random."),
          number_field("size", params.size, 0.01, 0.2, "scale", "Size of one."),
          text_field("path", params.path, "File or folder."),
          choice_field("mode", params.mode, "How to search."),
          list_field("channels", params.channels, "What to compute.", check_channel)};
}

}  // namespace cosegraph::graph::test
