// One act of the story: a station from its start to its stop, what robot r1 does there, and what is written down of it.
#pragma once

#include "tests/goldens/answers.hpp"
#include "tests/goldens/golden_station.hpp"
#include "tests/goldens/recorded_story.hpp"
#include "tests/goldens/story_frames.hpp"

namespace server {

inline constexpr const char* kCommandsOfR1 = "/api/v1/robots/r1/commands";

class Act {
 public:
  Act(const std::filesystem::path& database, Story& story) : station{database}, story_{story} {}

  GoldenStation station;

 protected:
  void keep(const std::string& name, const std::string& target) {
    story_.documents.emplace_back("story/" + name, answer_text(target, station.ask("GET", target)));
  }
  void keep_text(const std::string& name, std::string text) {
    story_.documents.emplace_back("story/" + name, std::move(text));
  }
  Answered post(const std::string& target, const json& body, int status) {
    Answered answered = station.ask("POST", target, body);
    EXPECT_EQ(answered.status, status) << target << ": " << answered.body;
    station.pass(0s);
    return answered;
  }
  // A command of r1 that the robot answers so.
  Answered command(const json& body, protocol::CommandResult result,
                   protocol::RejectReason reason = rheonaut_REJECT_REASON_NONE, std::uint64_t emergency_id = 0) {
    const auto answer = [&](const protocol::Command& sent) { r1->acknowledge(sent, result, emergency_id, reason); };
    return station.command(*r1, kCommandsOfR1, body, answer);
  }
  // Made at this moment, and not when the samples before it were.
  protocol::RobotFrame samples_now(std::uint64_t first_seq, pb_size_t count) const {
    protocol::RobotFrame frame = samples_of(first_seq, count);
    frame.body.telemetry.first_robot_time_us = r1->robot_now_us();
    return frame;
  }
  void send(protocol::RobotFrame frame, auto change, microseconds then = 50ms) {
    change(frame.body.telemetry);
    station.send(*r1, frame, then);
  }
  void event(std::uint64_t seq, protocol::EventKind kind, protocol::EventCause cause, auto change) {
    protocol::RobotFrame frame = event_of(seq, kind, cause);
    change(frame.body.event);
    station.send(*r1, frame);
  }

  TestRobot* r1 = nullptr;

 private:
  Story& story_;
};

}  // namespace server
