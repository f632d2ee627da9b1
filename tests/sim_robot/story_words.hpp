// The words of a test that tells what happens to a robot and its station, in virtual time: drive, await, expect, pass.
//
//   go_to(0.1);
//   await(position().within(0.005).of(0.1) and holding(), {.limit_s = 20});
//   expect_event("sub_state_changed");
//   send(set_duty(0.3F)).expect_refused("wrong_mode");
// The same over any two ends: `Story` has a robot, a bad network and the least of a station, `tests/system/
// station_fixture` the whole station. A class that derives from this brings its ends, and tests derive from that class,
// so that they tell without an object before each word. docs/test_stories.md is the guide.
//
// Errors:   StoryFailed, which says where, what was awaited for how long, and what was the case instead.
// Times:    seconds of virtual time. Conditions are looked at every 10 ms.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <source_location>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "sim_robot/lab/station_commands.hpp"
#include "tests/sim_robot/condition.hpp"

namespace sim_robot {

class StoryFailed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class StoryWords;

struct Limit {
  double limit_s = 5;
};
struct Within {
  double within_s = 1;
};
struct For {
  double for_s = 1;
};
struct Drive {
  double duty = 0;
  double for_s = 1;
};

// A command on its way.
class Sent {
 public:
  using Where = std::source_location;

  Sent(StoryWords& story, std::uint64_t id) : story_(story), id_(id) {}

  std::uint64_t id() const { return id_; }
  Answer expect_accepted(Limit limit = {}, Where where = Where::current()) const;
  // With this reason, or as "expired", "duplicate" or "other_boot".
  Answer expect_refused(std::string_view reason, Limit limit = {}, Where where = Where::current()) const;
  Answer answer(Limit limit = {}, Where where = Where::current()) const;  // whatever it is

 private:
  StoryWords& story_;
  std::uint64_t id_;
};

class StoryWords {
 public:
  using Where = std::source_location;

  virtual ~StoryWords() = default;
  StoryWords(const StoryWords&) = delete;
  StoryWords& operator=(const StoryWords&) = delete;

  void pass(double seconds);
  // The seconds it took.
  double await(const Condition& condition, Limit limit = {}, Where where = Where::current());
  void expect(const Condition& condition, Where where = Where::current());               // now
  void holds(const Condition& condition, For duration, Where where = Where::current());  // now and all the time

  // Each event heard since the story began answers one expectation. `kind` is spelled as in docs/protocol.md.
  ReceivedEvent expect_event(std::string_view kind, Within within = {}, Where where = Where::current());
  // These in this order, whatever is in between.
  void expect_events(std::initializer_list<std::string_view> kinds, Within within = {}, Where where = Where::current());
  // None but those expected before.
  void expect_no_event(std::string_view kind, Where where = Where::current());

  Sent send(const protocol::Command& command);
  // Each of these is accepted, and has been seen in telemetry when it returns.
  void go_to(double setpoint_m, Where where = Where::current());  // auto, or within auto the setpoint alone
  Answer stop(Where where = Where::current());                    // emergency
  Answer clear(Where where = Where::current());                   // the emergency that the station has heard of
  // Manual at a duty under a renewed lease for so long; then the duty is 0.
  void drive(const Drive& drive, Where where = Where::current());
  // The same for as long as the story goes on, until let_go() or another command for the motor.
  void start_driving(double duty, Where where = Where::current());
  void let_go(Where where = Where::current());

  virtual Moment moment() const = 0;
  const std::vector<ReceivedEvent>& events() const { return events_; }

 protected:
  StoryWords() = default;
  void forget();                                                          // for a new beginning
  void receive(const ReceivedEvent& event) { events_.push_back(event); }  // once for each
  [[noreturn]] void fail(const std::string& what, const std::string& instead, Where where) const;

 private:
  friend Sent;
  struct Given {
    std::uint64_t id = 0;
    std::string kind;
  };
  static constexpr double kRenewalS = 0.1;

  // The ends.
  virtual void step() = 0;  // 10 ms for both
  virtual std::uint64_t give(const protocol::Command& command) = 0;
  virtual std::optional<Answer> answer_to(std::uint64_t command_id) const = 0;

  void tick();
  std::optional<std::size_t> find_event(std::string_view kind, std::size_t from) const;
  std::size_t take_event(std::string_view kind, std::size_t from, double until_s);  // their number when none comes
  Answer await_answer(std::uint64_t id, Limit limit, Where where);
  std::string events_text() const;
  std::string commands_text() const;
  const std::string& kind_of(std::uint64_t command_id) const;

  std::vector<ReceivedEvent> events_;
  std::vector<bool> was_expected_;  // of events_, as far as it goes
  std::vector<Given> given_;
  bool is_driving_ = false;
  double renewed_at_s_ = 0;
};

}  // namespace sim_robot
