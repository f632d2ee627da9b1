// A station's life under power cuts, in virtual time: robots that never stop making samples, what they and people were
// told is durable, and after each cut the question whether the database still holds it.
//
//   StationLife life{seed, Mutant::none};
//   const Faults faults = life.live(8);        // eight cuts, then a good end; ends early at the first fault
//
// Everything is drawn from the seed. One life at a time: it makes itself SQLite's default VFS.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "tests/server/recording/forgetful_vfs.hpp"
#include "tests/server/recording/recording_audit.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {

// A mistake that the station does not make, to show that it would be found.
enum class Mutant : std::uint8_t { none, synchronous_off, acknowledges_on_reception };

class StationLife final : public RecordingTest {
 public:
  StationLife(unsigned seed, Mutant mutant);
  ~StationLife() override;

  Faults live(int cuts);
  // Where the power failed, or the station was killed, so far.
  const std::vector<std::string>& cuts() const { return cuts_; }

 private:
  // A robot with its ring: what it made and neither lost nor was told is durable.
  struct RingRobot {
    TestRobot own;
    bool is_connected = false;
    std::uint64_t next_event_seq = 0;
    std::uint64_t oldest_event_seq = 0;
  };

  void TestBody() override {}

  void live_until_cut();
  void begin();
  void check_stops();
  void end_well();
  void send_the_rest(RingRobot& robot);
  void note(const Faults& faults, const char* when);

  void act();
  void make_samples(RingRobot& robot, std::uint64_t count);
  void send_held(const RingRobot& robot, std::uint64_t first_seq, std::uint64_t count);
  void answer_missing();
  void make_event(RingRobot& robot);
  void send_event(const RingRobot& robot, std::uint64_t event_seq);
  void send_held_events(const RingRobot& robot);
  void let_go(RingRobot& robot);
  void acknowledge(station::BootId boot_id, std::uint64_t next_seq, std::uint64_t next_event_seq);

  void start_boot(RingRobot& robot);
  void reboot(RingRobot& robot);
  void join(RingRobot& robot);
  void leave(RingRobot& robot);

  void make_record();
  void flush_records();
  void make_or_end_run(const RingRobot& robot);
  void care_for_database();
  void restart();

  std::uint64_t pick(std::uint64_t limit) { return random_() % std::max<std::uint64_t>(limit, 1); }

  unsigned seed_ = 0;
  Mutant mutant_ = Mutant::none;
  std::mt19937 random_;
  Survival survival_ = Survival::nothing;
  ForgetfulVfs vfs_;

  std::vector<RingRobot> robots_;
  RecordingTruth truth_;
  std::map<station::BootId, storage::IntervalSet> received_;
  std::map<station::BootId, std::vector<Missing>> asked_;
  std::set<station::BootId> asked_events_;
  station::CommandId last_command_id_ = 0;
  std::vector<station::CommandId> moving_commands_;  // of this session
  std::set<std::uint64_t> station_events_;           // not flushed yet
  std::uint64_t last_station_event_ = 0;
  std::optional<storage::RunId> open_run_;

  Faults faults_;
  std::vector<std::string> cuts_;
};

}  // namespace server
