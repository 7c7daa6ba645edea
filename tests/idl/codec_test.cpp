#include "idl/codec.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace cosegraph::idl {
namespace {

using testing::HasSubstr;

const FrameHeader kHeader{.graph = "segment",
                          .stage = "camera",
                          .generation = 3,
                          .source = "camera",
                          .epoch = 12345678901234ULL,
                          .sequence = 42,
                          .stamp = -7,
                          .model_id = 0xfedcba9876543210ULL,
                          .name = "mug 1"};

Cloud example_cloud() {
  return {.xyz = {1, 2, 3, 4, 5, 6},
          .normal = {0, 0, 1, 0, 1, 0},
          .label = {1, kNoLabel},
          .label_names = {"body", "handle"},
          .origin = {0.5F, 0.0F, -1.0F},
          .scale = 2.5F,
          .recipe = "spacing=0.014",
          .dense_index = {3, kNoPoint},
          .notes = {"reduced"},
          .width = 2,
          .height = 1,
          .frame_id = "camera",
          .stamp = 9};
}

AppearanceModel example_appearance() {
  return {.id = 77,
          .label_names = {"body", "handle"},
          .label_share = {0.75F, 0.25F},
          .cloud_recipe = "a=1",
          .descriptor_recipe = "b=2",
          .encoding_recipe = "c=3",
          .channels = {{.name = "fpfh:0.08",
                        .dimension = 2,
                        .projection =
                            {.input = 2, .output = 1, .mean = {0.5F, 0.25F}, .basis = {1.0F, 0.0F}},
                        .mixture = {.components = 1,
                                    .dimension = 1,
                                    .weight = {1.0F},
                                    .mean = {0.0F},
                                    .sigma = {1.0F}},
                        .block_scale = 2.0F}},
          .classifier = {.kernel = "linear",
                         .dimension = 2,
                         .label_count = 2,
                         .weight = {1, 2, 3, 4},
                         .bias = {0.1F, 0.2F}}};
}

RelationModel example_relations() {
  const DistanceMixture mixture{.weight = {0.5F, 0.5F}, .mean = {1, 2}, .sigma = {0.1F, 0.2F}};
  return {.id = 77,
          .label_names = {"body", "handle"},
          .spectrum_recipe = "samples=500",
          .pairs = {mixture, {}, mixture},
          .neighbours = {1, 1, 1, 1}};
}

template <class Value>
Value round_trip(const Value& value) {
  return decode<Value>(encode(kHeader, value));
}

TEST(Codec, HeaderSurvivesInFrontOfEveryPayload) {
  const FrameHeader header = decode_header(encode(kHeader, example_cloud()));
  EXPECT_EQ(header.graph, kHeader.graph);
  EXPECT_EQ(header.stage, kHeader.stage);
  EXPECT_EQ(header.generation, kHeader.generation);
  EXPECT_EQ(header.source, kHeader.source);
  EXPECT_EQ(header.epoch, kHeader.epoch);
  EXPECT_EQ(header.sequence, kHeader.sequence);
  EXPECT_EQ(header.stamp, kHeader.stamp);
  EXPECT_EQ(header.model_id, kHeader.model_id);
  EXPECT_EQ(header.name, kHeader.name);
}

TEST(Codec, EpochIsReplacedAndNothingElse) {
  FrameHeader header = kHeader;
  for (const std::string name : {"", "a", "ab", "abc", "abcdefgh"}) {
    header.source = name;
    header.epoch = 5;
    Bytes bytes = encode(header, example_cloud());
    header.epoch = 0x0123456789abcdefULL;
    set_epoch(bytes, header.epoch);
    EXPECT_EQ(bytes, encode(header, example_cloud())) << name;
  }
  Bytes damaged(10, 0xff);
  EXPECT_THROW(set_epoch(damaged, 1), InputError);
}

TEST(Codec, CloudSurvives) {
  const Cloud before = example_cloud();
  const Cloud after = round_trip(before);
  EXPECT_EQ(after.xyz, before.xyz);
  EXPECT_EQ(after.normal, before.normal);
  EXPECT_EQ(after.rgb, before.rgb);
  EXPECT_EQ(after.label, before.label);
  EXPECT_EQ(after.label_names, before.label_names);
  EXPECT_EQ(after.origin, before.origin);
  EXPECT_EQ(after.scale, before.scale);
  EXPECT_EQ(after.recipe, before.recipe);
  EXPECT_EQ(after.dense_index, before.dense_index);
  EXPECT_EQ(after.notes, before.notes);
  EXPECT_EQ(after.width, before.width);
  EXPECT_EQ(after.height, before.height);
  EXPECT_EQ(after.frame_id, before.frame_id);
  EXPECT_EQ(after.stamp, before.stamp);
}

TEST(Codec, AdjacencySurvivesFlattening) {
  const Segments before{.of_supervoxel = {0, 0, 1, 2},
                        .of_point = {0, 1, 2, 2, 2},
                        .count = 3,
                        .adjacency = {{0, 1}, {1, 2}},
                        .concavity = {0.25F, 1.0F}};
  const Segments after = round_trip(before);
  EXPECT_EQ(after.of_supervoxel, before.of_supervoxel);
  EXPECT_EQ(after.of_point, before.of_point);
  EXPECT_EQ(after.count, before.count);
  EXPECT_EQ(after.adjacency, before.adjacency);
  EXPECT_EQ(after.concavity, before.concavity);
}

TEST(Codec, DescriptorChannelsSurvive) {
  const Descriptors before{
      .recipe = "channels=x",
      .channels = {{.name = "fpfh:0.08", .dimension = 2, .keypoint = {0, 5}, .value = {1, 2, 3, 4}},
                   {.name = "shot:0.13", .dimension = 1, .keypoint = {7}, .value = {9}}}};
  const Descriptors after = round_trip(before);
  ASSERT_EQ(after.channels.size(), 2U);
  EXPECT_EQ(after.recipe, before.recipe);
  for (std::size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(after.channels[c].name, before.channels[c].name);
    EXPECT_EQ(after.channels[c].dimension, before.channels[c].dimension);
    EXPECT_EQ(after.channels[c].keypoint, before.channels[c].keypoint);
    EXPECT_EQ(after.channels[c].value, before.channels[c].value);
  }
}

TEST(Codec, ModelHalvesSurvive) {
  const AppearanceModel appearance = round_trip(example_appearance());
  EXPECT_EQ(appearance.id, 77U);
  EXPECT_EQ(appearance.label_share, example_appearance().label_share);
  ASSERT_EQ(appearance.channels.size(), 1U);
  EXPECT_EQ(appearance.channels[0].projection.basis,
            example_appearance().channels[0].projection.basis);
  EXPECT_EQ(appearance.classifier.weight, example_appearance().classifier.weight);

  const RelationModel relations = round_trip(example_relations());
  ASSERT_EQ(relations.pairs.size(), 3U);
  EXPECT_EQ(relations.pairs[0].mean, example_relations().pairs[0].mean);
  EXPECT_TRUE(relations.pairs[1].weight.empty());
  EXPECT_EQ(relations.pairs[2].sigma, example_relations().pairs[2].sigma);
  EXPECT_EQ(relations.neighbours, example_relations().neighbours);
}

TEST(Codec, ControlMessagesSurvive) {
  EXPECT_EQ(round_trip(StreamEnd{9}).count, 9U);
  EXPECT_EQ(round_trip(FrameFailure{"why"}).reason, "why");
  const FrameDone done = round_trip(FrameDone{Outcome::failed, "cpc", "no supervoxels"});
  EXPECT_EQ(done.outcome, Outcome::failed);
  EXPECT_EQ(done.failed_stage, "cpc");
  StageStatus status;
  status.state = State::working;
  status.account = {.admitted = 5, .labelled = 2, .consumed = 1, .failed = 1, .dropped = 4};
  status.recipe = "a=1";
  status.settled = 11;
  status.ports = {{.name = "out", .topic = "g/s/out", .output = true, .messages = 3, .bytes = 99}};
  const StageStatus seen = round_trip(status);
  EXPECT_EQ(seen.recipe, "a=1");
  EXPECT_EQ(seen.settled, 11U);
  ASSERT_EQ(seen.ports.size(), 1U);
  EXPECT_EQ(seen.ports[0].topic, "g/s/out");
  EXPECT_TRUE(seen.ports[0].output);
  EXPECT_EQ(seen.ports[0].bytes, 99U);
  EXPECT_EQ(seen.state, State::working);
  EXPECT_EQ(seen.account.admitted, 5U);
  EXPECT_EQ(seen.account.dropped, 4U);
}

TEST(Codec, SameValueGivesSameBytes) {
  EXPECT_EQ(encode(kHeader, example_cloud()), encode(kHeader, example_cloud()));
}

TEST(Codec, EmptyCloudSurvives) {
  const Cloud after = round_trip(Cloud{.height = 1});
  EXPECT_EQ(after.size(), 0U);
}

TEST(Codec, TruncationAtEveryByteIsRefused) {
  const Bytes whole = encode(kHeader, example_cloud());
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_THROW(decode<Cloud>(std::span(whole).first(length)), InputError) << length;
}

// What is walked over must be what the generated code writes, for every type.
template <class Value>
std::size_t whole_size(const Value& value) {
  Bytes bytes = encode(kHeader, value);
  decode<Value>(bytes);
  std::size_t shortest = bytes.size();
  while (shortest > 0) {
    try {
      decode<Value>(std::span(bytes).first(shortest - 1));
      --shortest;
    } catch (const InputError&) {
      break;
    }
  }
  return bytes.size() - shortest;
}

TEST(Codec, LayoutsEndWhereMessagesEnd) {
  EXPECT_EQ(whole_size(example_cloud()), 0U);
  EXPECT_EQ(whole_size(example_appearance()), 0U);
  EXPECT_EQ(whole_size(example_relations()), 0U);
  EXPECT_EQ(whole_size(Segments{.of_supervoxel = {0, 1},
                                .of_point = {0},
                                .count = 2,
                                .adjacency = {{0, 1}},
                                .concavity = {0.5F}}),
            0U);
  EXPECT_EQ(whole_size(Supervoxels{.of_point = {0},
                                   .centroid = {0, 0, 0, 1, 0, 0},
                                   .normal = {0, 0, 1, 0, 0, 1},
                                   .point_count = {1, 0},
                                   .adjacency = {{0, 1}},
                                   .seed_resolution = 1.0F}),
            0U);
  EXPECT_EQ(whole_size(Descriptors{
                .recipe = "r",
                .channels = {{.name = "c", .dimension = 1, .keypoint = {0}, .value = {1.0F}}}}),
            0U);
  EXPECT_EQ(whole_size(Spectrum{.recipe = "r",
                                .sample = {0},
                                .sample_dense = {0},
                                .eigenvalue = {1.0F},
                                .eigenfunction = {1.0F},
                                .component = {0},
                                .nearest_sample = {0}}),
            0U);
  EXPECT_EQ(
      whole_size(Encodings{.segment_count = 1, .dimension = 1, .segment = {0}, .value = {1.0F}}),
      0U);
  EXPECT_EQ(whole_size(Scores{.label_names = {"a"}, .segment_count = 1, .probability = {1.0F}}),
            0U);
  EXPECT_EQ(whole_size(Labelling{.label_names = {"a"},
                                 .segment_label = {0},
                                 .segment_confidence = {1.0F},
                                 .point_label = {0},
                                 .point_confidence = {1.0F}}),
            0U);
  EXPECT_EQ(whole_size(StreamEnd{1}), 0U);
  EXPECT_EQ(whole_size(FrameFailure{"x"}), 0U);
  EXPECT_EQ(whole_size(FrameDone{Outcome::failed, "a", "b"}), 0U);
  EXPECT_EQ(whole_size(StageStatus{.kind = "k",
                                   .host = "h",
                                   .activity = "a",
                                   .ports = {{.name = "p", .topic = "t"}, {.output = true}}}),
            0U);
  EXPECT_EQ(whole_size(Command{.verb = "swap", .words = {"a", "bc"}}), 0U);
  EXPECT_EQ(whole_size(Reply{.host = "h", .text = "fine"}), 0U);
  EXPECT_EQ(whole_size(AgentStatus{.host = "h", .processes = {{.stage = "a"}, {.text = "b"}}}), 0U);
  EXPECT_EQ(whole_size(LogLines{.host = "h", .stage = "s", .lines = {"one", "two"}}), 0U);
}

// What an array claims to hold is bounded by the bytes that are there.
TEST(Codec, ImpossibleLengthIsRefusedWithoutAllocatingIt) {
  Bytes bytes = encode(kHeader, Cloud{.height = 1});
  // The first sequence length after the header is that of xyz; find it as the first run of zeros
  // behind the name "mug 1\0" on a 4-byte boundary.
  const std::string name = "mug 1";
  const auto at = std::search(bytes.begin(), bytes.end(), name.begin(), name.end());
  ASSERT_NE(at, bytes.end());
  std::size_t offset = static_cast<std::size_t>(at - bytes.begin()) + name.size() + 1;
  while ((offset - 4) % 4 != 0) ++offset;
  for (int i = 0; i < 4; ++i) bytes[offset + static_cast<std::size_t>(i)] = 0xff;
  EXPECT_THROW(decode<Cloud>(bytes), InputError);
}

TEST(Codec, RefusalNamesTypeAndReason) {
  Cloud cloud = example_cloud();
  cloud.label = {5, 0};
  const Bytes bytes = encode(kHeader, cloud);
  try {
    decode<Cloud>(bytes);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("Cloud"));
    EXPECT_THAT(error.what(), HasSubstr("label 5 has no name"));
  }
}

TEST(Codec, IndicesThatPointNowhereAreRefused) {
  Segments segments{.of_supervoxel = {0, 1}, .of_point = {0, 7}, .count = 2};
  EXPECT_THROW(round_trip(segments), InputError);
  Supervoxels supervoxels{.of_point = {0},
                          .centroid = {0, 0, 0},
                          .normal = {0, 0, 1},
                          .point_count = {1},
                          .adjacency = {{0, 3}},
                          .seed_resolution = 1.0F};
  EXPECT_THROW(round_trip(supervoxels), InputError);
  Labelling labelling{.label_names = {"a"}, .segment_label = {1}, .segment_confidence = {1.0F}};
  EXPECT_THROW(round_trip(labelling), InputError);
}

TEST(Codec, OrdersAndReportsOfAgentsSurvive) {
  const Command command = round_trip(Command{.id = 9,
                                             .host = "rack",
                                             .stage = "cpc",
                                             .generation = 2,
                                             .verb = "swap",
                                             .words = {"--param", "a=b"}});
  EXPECT_EQ(command.id, 9U);
  EXPECT_EQ(command.host, "rack");
  EXPECT_EQ(command.stage, "cpc");
  EXPECT_EQ(command.generation, 2U);
  EXPECT_EQ(command.verb, "swap");
  EXPECT_THAT(command.words, testing::ElementsAre("--param", "a=b"));
  const Reply reply = round_trip(Reply{9, "rack", ReplyState::refused, "busy"});
  EXPECT_EQ(reply.state, ReplyState::refused);
  EXPECT_EQ(reply.text, "busy");
  const AgentStatus agent = round_trip(AgentStatus{.host = "rack",
                                                   .address = "10.0.0.3",
                                                   .pid = 5,
                                                   .processes = {{.stage = "cpc",
                                                                  .replica = 1,
                                                                  .generation = 2,
                                                                  .pid = 6,
                                                                  .state = ProcessState::restarting,
                                                                  .restarts = 3,
                                                                  .text = "was killed"}},
                                                   .swapping = "svm",
                                                   .newcomer = 7});
  ASSERT_EQ(agent.processes.size(), 1U);
  EXPECT_EQ(agent.processes[0].replica, 1U);
  EXPECT_EQ(agent.processes[0].state, ProcessState::restarting);
  EXPECT_EQ(agent.processes[0].text, "was killed");
  EXPECT_EQ(agent.swapping, "svm");
  EXPECT_EQ(agent.newcomer, 7U);
  const LogLines log = round_trip(LogLines{.host = "h", .stage = "s", .lines = {"one", "two"}});
  EXPECT_THAT(log.lines, testing::ElementsAre("one", "two"));
}

TEST(Codec, AdjacencyThatIsNoListOfDifferentPairsIsRefused) {
  Segments segments{.of_supervoxel = {0, 1, 2}, .count = 3, .concavity = {0.5F, 0.5F}};
  for (const auto& adjacency : {std::vector<std::array<std::int32_t, 2>>{{0, 1}, {0, 1}},
                                {{1, 2}, {0, 1}},
                                {{0, 1}, {2, 1}},
                                {{0, 1}, {2, 2}}}) {
    segments.adjacency = adjacency;
    EXPECT_THROW(round_trip(segments), InputError);
  }
}

// What a message can claim without having the bytes for it.
TEST(Codec, NumbersOfSegmentsAreBounded) {
  EXPECT_NO_THROW(round_trip(Encodings{.segment_count = kMostSegments, .dimension = 1}));
  EXPECT_THROW(round_trip(Encodings{.segment_count = kMostSegments + 1, .dimension = 1}),
               InputError);
}

// Fisher vectors are mostly zeros, which do not travel.
TEST(Codec, ZerosCostNothing) {
  Encodings encodings{.segment_count = 2, .dimension = 1000, .segment = {0, 1, 1}};
  encodings.value.resize(3000);
  const std::size_t empty = encode(kHeader, encodings).size();
  EXPECT_EQ(round_trip(encodings).value, encodings.value);
  EXPECT_LT(empty, 300U);
  // At the start, alone, with short gaps, a zero that has a sign, across packets, at the end.
  for (const std::size_t i : {0, 1, 5, 100, 102, 500, 998, 999, 1000, 1001, 2999})
    encodings.value[i] = static_cast<float>(i) + 0.5F;
  encodings.value[700] = -0.0F;
  const Encodings got = round_trip(encodings);
  EXPECT_EQ(got.value, encodings.value);
  EXPECT_TRUE(std::signbit(got.value[700]));
  EXPECT_FALSE(std::signbit(got.value[701]));
  EXPECT_LT(encode(kHeader, encodings).size(), empty + 200);
  std::ranges::fill(encodings.value, 1.0F);
  EXPECT_EQ(round_trip(encodings).value, encodings.value);
  constexpr std::size_t kBits = 3000 / 8 + 20;  // bytes
  EXPECT_LT(encode(kHeader, encodings).size(), empty + 3000 * sizeof(float) + kBits);
}

// Histograms likewise.
TEST(Codec, ZerosOfDescriptorsCostNothing) {
  Descriptors descriptors{.recipe = "r"};
  auto& channel = descriptors.channels.emplace_back(
      DescriptorChannel{.name = "shot:0.1", .dimension = 352, .keypoint = {3, 9}});
  channel.value.resize(704);
  channel.value[350] = 0.5F;
  const Descriptors got = round_trip(descriptors);
  ASSERT_EQ(got.channels.size(), 1U);
  EXPECT_EQ(got.channels[0].value, channel.value);
  EXPECT_LT(encode(kHeader, descriptors).size(), 300U);
  channel.value.pop_back();
  EXPECT_THROW(round_trip(descriptors), InputError);
}

TEST(Codec, EncodingsThatClaimMoreThanThereIsAreRefused) {
  Encodings encodings{.segment_count = 1, .dimension = 3, .segment = {0}, .value = {1, 2}};
  EXPECT_THROW(round_trip(encodings), InputError);
  encodings.value = {1, 2, 3, 4};
  EXPECT_THROW(round_trip(encodings), InputError);
  // Zeros take no bytes: the memory that they would take is bounded.
  encodings = {.segment_count = 1, .dimension = std::numeric_limits<std::int32_t>::max()};
  encodings.segment.assign(1000, 0);
  EXPECT_THROW(round_trip(encodings), InputError);
}

TEST(Codec, VectorsThatAreNotFiniteAreRefused) {
  Encodings encodings{.segment_count = 1, .dimension = 2, .segment = {0}, .value = {1.0F, 2.0F}};
  EXPECT_NO_THROW(round_trip(encodings));
  encodings.value[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(round_trip(encodings), InputError);
}

TEST(Codec, SpectrumThatWouldGiveNoDistancesIsRefused) {
  const Spectrum fine{.recipe = "r",
                      .sample = {0},
                      .sample_dense = {0},
                      .eigenvalue = {1.0F},
                      .eigenfunction = {1.0F},
                      .component = {0},
                      .nearest_sample = {0}};
  EXPECT_NO_THROW(round_trip(fine));
  Spectrum odd = fine;
  odd.eigenvalue = {1e-44F};  // its inverse is infinite
  EXPECT_THROW(round_trip(odd), InputError);
  odd = fine;
  odd.eigenfunction = {std::numeric_limits<float>::quiet_NaN()};
  EXPECT_THROW(round_trip(odd), InputError);
}

TEST(Codec, CheckIsDecodeByName) {
  const Bytes bytes = encode(kHeader, example_cloud());
  EXPECT_NO_THROW(check("Cloud", bytes));
  EXPECT_THROW(check("Cloud", std::span(bytes).first(bytes.size() - 1)), InputError);
  EXPECT_THROW(check("Teapot", bytes), InputError);
  for (const auto type : type_names()) EXPECT_THROW(check(type, {}), InputError) << type;
}

TEST(Codec, EveryEnumValueHasAName) {
  for (const auto& [value, name] : names<State>()) EXPECT_EQ(from_name<State>(name), value);
  for (const auto& [value, name] : names<Outcome>()) EXPECT_EQ(from_name<Outcome>(name), value);
  for (const auto& [value, name] : names<ReplyState>())
    EXPECT_EQ(from_name<ReplyState>(name), value);
  for (const auto& [value, name] : names<ProcessState>())
    EXPECT_EQ(from_name<ProcessState>(name), value);
}

}  // namespace
}  // namespace cosegraph::idl
