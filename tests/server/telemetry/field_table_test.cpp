// The table against robot.proto, and the copy of a frame that it steers.
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <regex>
#include <set>

#include "tests/server/telemetry/field_names.hpp"

namespace server {
namespace {

// Fields of Telemetry that place its samples in time, and are no values.
const std::set<std::string> kPlaces{"first_seq", "first_robot_time_us", "period_us", "oldest_seq"};

// Name and type of each field of message Telemetry, e.g. "optional float".
std::map<std::string, std::string> fields_of_proto() {
  const std::string proto = project_file("protocol/robot.proto");
  const std::size_t begin = proto.find("message Telemetry {");
  const std::string message = proto.substr(begin, proto.find("\n}", begin) - begin);
  std::map<std::string, std::string> fields;
  const std::regex line{R"(\n  ((?:\w+ )?\w+) (\w+) = \d+;)"};
  for (std::sregex_iterator at{message.begin(), message.end(), line}, end; at != end; ++at) {
    if (!kPlaces.contains((*at)[2])) fields[(*at)[2]] = (*at)[1];
  }
  return fields;
}

std::string type_in_proto(const station::BatchField<std::optional<float>>& field) {
  return field.has == nullptr ? "float" : "optional float";
}
std::string type_in_proto(const station::BatchField<std::uint32_t>&) { return "uint32"; }
std::string type_in_proto(const station::BatchField<std::uint64_t>&) { return "fixed64"; }
std::string type_in_proto(const station::BatchField<protocol::Mode>&) { return "Mode"; }
std::string type_in_proto(const station::BatchField<protocol::SubState>&) { return "SubState"; }
std::string type_in_proto(const station::BatchField<protocol::EmergencyCause>&) { return "EmergencyCause"; }

TEST(TelemetryFields, AreTheFieldsOfTheProtocolWithTheirTypes) {
  std::map<std::string, std::string> fields;
  station::for_each_sample_field([&](const auto& field) { fields[field.name] = "repeated float"; });
  station::for_each_batch_field([&](const auto& field) { fields[field.name] = type_in_proto(field); });
  EXPECT_EQ(fields, fields_of_proto());
}

// Another one for each number; of enumerators one that all have.
template <class Field>
Field::Wire value_of(float number) {
  return static_cast<Field::Wire>(Field::kKind == station::FieldKind::enumerator ? 2 : number);
}

TEST(TelemetryFields, CopyEachColumnAndEachValueOfAFrameIntoItsMember) {
  protocol::Telemetry frame = rheonaut_Telemetry_init_zero;
  frame.position_m_count = 2;
  frame.period_us = 10'000;
  float next = 1;
  station::for_each_sample_field([&](const station::SampleField& field) {
    (frame.*field.wire)[0] = next++;
    (frame.*field.wire)[1] = next++;
  });
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    frame.*field.wire = value_of<station::BatchField<Value>>(next++);
    if (field.has != nullptr) frame.*field.has = true;
  });

  std::vector<station::Sample> samples;
  copy_samples(frame, samples);
  const station::SampleContext context = station::context_of(frame);
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(context.period_us, 10'000u);
  float expected = 1;
  station::for_each_sample_field([&](const station::SampleField& field) {
    EXPECT_EQ(samples[0].*field.member, expected++) << field.name;
    EXPECT_EQ(samples[1].*field.member, expected++) << field.name;
  });
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    EXPECT_EQ(context.*field.member, value_of<station::BatchField<Value>>(expected++)) << field.name;
  });
}

TEST(TelemetryFields, TakeWhatIsNotFiniteOrNotThereAsNone) {
  protocol::Telemetry frame = rheonaut_Telemetry_init_zero;
  station::for_each_batch_field_of<station::FieldKind::number>([&](const auto& field) {
    frame.*field.wire = field.has == nullptr ? std::numeric_limits<float>::infinity() : 1.0F;
  });
  const station::SampleContext context = station::context_of(frame);
  station::for_each_batch_field_of<station::FieldKind::number>(
      [&](const auto& field) { EXPECT_EQ(context.*field.member, std::nullopt) << field.name; });
}

}  // namespace
}  // namespace server
