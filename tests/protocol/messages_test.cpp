// Every enumerator has its own text, every message survives a round trip, and no bytes crash the decoder.
#include "protocol/messages.hpp"

#include <gtest/gtest.h>
#include <pb_common.h>

#include <cstring>
#include <random>
#include <set>
#include <string>

#include "golden_file.hpp"

namespace protocol {
namespace {

using ByteVector = std::vector<std::uint8_t>;
using Random = std::mt19937_64;

Bytes view(const ByteVector& bytes) { return {bytes.data(), bytes.size()}; }

template <class Frame>
ByteVector encoded(const Frame& frame) {
  ByteVector bytes(kMaxFrameBytes);
  bytes.resize(encode(frame, bytes.data(), bytes.size()));
  return bytes;
}

// Checks text() of the enumerators first..last, which robot.proto numbers without holes.
template <class Enum>
void expect_own_texts(Enum first, Enum last) {
  std::set<std::string> texts;
  for (int value = first; value <= last; ++value) {
    const std::string name = text(static_cast<Enum>(value));
    EXPECT_TRUE(texts.insert(name).second) << name << " is the text of two values";
    EXPECT_NE(name, "") << value;
    if (!(std::is_same_v<Enum, ResetCause> && value == rheonaut_RESET_CAUSE_UNKNOWN)) {
      EXPECT_NE(name, "unknown") << value;
    }
  }
  EXPECT_STREQ(text(static_cast<Enum>(last + 1)), "unknown");
}

TEST(Text, IsUniqueForEveryEnumeratorAndUnknownForOthers) {
  expect_own_texts(_rheonaut_Mode_MIN, _rheonaut_Mode_MAX);
  expect_own_texts(_rheonaut_SubState_MIN, _rheonaut_SubState_MAX);
  expect_own_texts(_rheonaut_ResetCause_MIN, _rheonaut_ResetCause_MAX);
  expect_own_texts(_rheonaut_EmergencyCause_MIN, _rheonaut_EmergencyCause_MAX);
  expect_own_texts(_rheonaut_EventKind_MIN, _rheonaut_EventKind_MAX);
  expect_own_texts(_rheonaut_EventCause_MIN, _rheonaut_EventCause_MAX);
  expect_own_texts(_rheonaut_CommandResult_MIN, _rheonaut_CommandResult_MAX);
  expect_own_texts(_rheonaut_RejectReason_MIN, _rheonaut_RejectReason_MAX);
  expect_own_texts(_rheonaut_RefusalReason_MIN, _rheonaut_RefusalReason_MAX);
}

TEST(Kind, IsUniqueForEveryActionAndUnknownForOthers) {
  std::set<std::string> kinds;
  Command command = rheonaut_Command_init_zero;
  for (pb_size_t tag = rheonaut_Command_set_mode_tag; tag <= rheonaut_Command_drop_timed_tag; ++tag) {
    command.which_action = tag;
    EXPECT_TRUE(kinds.insert(kind(command)).second) << kind(command) << " names two actions";
  }
  EXPECT_EQ(kinds.count("unknown"), 0u);
  command.which_action = 0;
  EXPECT_STREQ(kind(command), "unknown");
}

// Half of the numbers use all bits, the others are small, since varints differ in length.
std::uint64_t random_number(Random& random) { return random() % 2 == 0 ? random() : random() % 200; }

void fill_scalar(const pb_field_iter_t& field, std::uint8_t* at, Random& random) {
  if (PB_LTYPE(field.type) == PB_LTYPE_STRING) {
    const std::size_t length = random() % field.data_size;
    for (std::size_t i = 0; i < length; ++i) at[i] = static_cast<std::uint8_t>('a' + random() % 26);
    at[length] = 0;
    return;
  }
  const std::uint64_t number = random_number(random);
  std::memcpy(at, &number, field.data_size);
}

// Fills a message of any type with random values, through nanopb's own description of its fields: so a new field is
// covered without a change here. Repeated fields of one message get the same length, as columns must have.
void fill(const pb_msgdesc_t* description, void* message, Random& random) {
  const std::size_t length = 1 + random() % 64;
  std::size_t member = random() % 64;  // of a oneof: the (member mod count)-th
  std::vector<pb_size_t> members;
  pb_field_iter_t field;
  if (!pb_field_iter_begin(&field, description, message)) return;  // a message without fields
  do {
    if (PB_HTYPE(field.type) == PB_HTYPE_ONEOF) members.push_back(field.tag);
  } while (pb_field_iter_next(&field));
  const pb_size_t chosen = members.empty() ? pb_size_t{0} : members[member % members.size()];
  do {
    auto* at = static_cast<std::uint8_t*>(field.pData);
    std::size_t count = 1;
    switch (PB_HTYPE(field.type)) {
      case PB_HTYPE_ONEOF:
        if (field.tag != chosen) continue;
        *static_cast<pb_size_t*>(field.pSize) = chosen;
        break;
      case PB_HTYPE_OPTIONAL:
        if (field.pSize != nullptr) *static_cast<bool*>(field.pSize) = random() % 2 == 0;
        break;
      case PB_HTYPE_REPEATED:
        count = std::min<std::size_t>(length, field.array_size);
        *static_cast<pb_size_t*>(field.pSize) = static_cast<pb_size_t>(count);
        break;
      default: break;
    }
    for (std::size_t i = 0; i < count; ++i, at += field.data_size) {
      if (PB_LTYPE_IS_SUBMSG(field.type)) {
        fill(field.submsg_desc, at, random);
      } else {
        fill_scalar(field, at, random);
      }
    }
  } while (pb_field_iter_next(&field));
}

template <class Frame>
Frame random_frame(const pb_msgdesc_t* description, Random& random) {
  Frame frame;
  std::memset(&frame, 0, sizeof frame);
  fill(description, &frame, random);
  return frame;
}

TEST(Messages, SurviveARoundTripWhateverTheirValues) {
  Random random{3};
  std::set<pb_size_t> bodies;
  std::set<pb_size_t> actions;
  for (int round = 0; round < 5000; ++round) {
    const auto robot = random_frame<RobotFrame>(rheonaut_RobotFrame_fields, random);
    bodies.insert(robot.which_body);
    const ByteVector robot_bytes = encoded(robot);
    const auto robot_again = decode_robot_frame(view(robot_bytes));
    ASSERT_TRUE(robot_again.has_value()) << "body " << robot.which_body;
    ASSERT_EQ(encoded(*robot_again), robot_bytes) << "body " << robot.which_body;

    const auto station = random_frame<StationFrame>(rheonaut_StationFrame_fields, random);
    if (station.which_body == rheonaut_StationFrame_command_tag) actions.insert(station.body.command.which_action);
    const ByteVector station_bytes = encoded(station);
    const auto station_again = decode_station_frame(view(station_bytes));
    ASSERT_TRUE(station_again.has_value()) << "body " << station.which_body;
    ASSERT_EQ(encoded(*station_again), station_bytes) << "body " << station.which_body;
  }
  EXPECT_EQ(bodies.size(), 9u);
  EXPECT_EQ(actions.size(), 15u);
}

TEST(Decode, NeverCrashesOnATruncatedFrame) {
  for (const GoldenFrame& golden : read_golden_frames()) {
    const ByteVector payload = golden.payload();
    for (std::size_t size = 0; size < payload.size(); ++size) {
      const ByteVector part(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(size));  // ASan sees its end
      const auto robot = decode_robot_frame(view(part));
      const auto station = decode_station_frame(view(part));
      if (robot) EXPECT_NE(robot->which_body, 0) << golden.name;
      if (station) EXPECT_NE(station->which_body, 0) << golden.name;
    }
  }
}

TEST(Decode, NeverCrashesOnADamagedFrame) {
  Random random{4};
  for (const GoldenFrame& golden : read_golden_frames()) {
    for (int round = 0; round < 200; ++round) {
      ByteVector payload = golden.payload();
      for (std::uint64_t damage = 1 + random() % 4; damage > 0; --damage) {
        payload[random() % payload.size()] = static_cast<std::uint8_t>(random());
      }
      if (const auto robot = decode_robot_frame(view(payload))) EXPECT_FALSE(encoded(*robot).empty()) << golden.name;
      if (const auto station = decode_station_frame(view(payload))) {
        EXPECT_FALSE(encoded(*station).empty()) << golden.name;
      }
    }
  }
}

TEST(Decode, RefusesAFrameWithoutKnownBodyAndSkipsUnknownFieldsInOne) {
  EXPECT_FALSE(decode_robot_frame({}).has_value());
  const ByteVector only_unknown_body{0xFA, 0x01, 0x00};                // field 31, empty
  const ByteVector heartbeat_with_more{0x1A, 0x03, 0xF8, 0x01, 0x05};  // heartbeat { field 31: 5 }
  EXPECT_FALSE(decode_robot_frame(view(only_unknown_body)).has_value());
  const auto frame = decode_robot_frame(view(heartbeat_with_more));
  ASSERT_TRUE(frame.has_value());
  EXPECT_EQ(frame->which_body, rheonaut_RobotFrame_heartbeat_tag);
}

}  // namespace
}  // namespace protocol
