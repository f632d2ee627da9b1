// A station whose database, clock and random bytes are given, with robots that send what the test gives them.
//
//   GoldenStation station{path_of_a_database};
//   station.live_text();                            // what pages received so far
//   station.finish();                               // SIGTERM
//
// Everything that it writes and says is the same in every run.
#pragma once

#include <functional>
#include <vector>

#include "server/api/live_messages.hpp"
#include "server/live/live_feed.hpp"
#include "server/live/robot_texts.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {

// From the clock of the tests to a day on which the database of schema version 6 is of the past, at 03:06:00 UTC: hour,
// minute and second begin with a zero.
inline constexpr microseconds kStoryAfter = std::chrono::hours{527 * 24 + 12} - 41s;

class GoldenStation final : public ApiTest {
 public:
  explicit GoldenStation(const std::filesystem::path& database);
  ~GoldenStation() override;

  // Welcomed, and alive from then on; the robot has booted so long ago.
  TestRobot& dial(const protocol::RobotFrame& hello, microseconds booted_ago = 5s);
  void pass(microseconds duration);  // pages read their messages meanwhile
  void send(TestRobot& from, const protocol::RobotFrame& frame, microseconds then = 0s);
  std::int64_t utc_us() const { return clock.utc_us(); }
  void step_utc(microseconds by) { clock.step_utc(by); }

  using ApiTest::ask;
  // The newest command of this kind is answered before the request is. Gives the answer to the request.
  using Reply = std::function<void(const protocol::Command&)>;
  Answered command(TestRobot& to, const std::string& path, const json& body, const Reply& reply);

  // The messages to a page when it opens, and after an invalid message of it.
  std::string welcome();
  std::string problem_of(const std::string& message);
  std::string dropped_message();  // the first message to a page that has read too slowly
  // Message by message, a line each: of a page that watches all, and of one that watches some robots; what they heard
  // while `is_kept`.
  bool is_kept = false;
  const std::string& heard_by_all() const { return heard_by_all_; }
  const std::string& heard_by_watcher() const { return heard_by_watcher_; }
  void watch(const std::set<station::RobotId>& robots) { live.watch(watcher_, robots); }

  void finish();  // every sample is on disk, open runs are interrupted
  std::filesystem::path database() const { return folder.path() / "station.sqlite"; }
  std::filesystem::path data_folder() const { return folder.path(); }

 private:
  void TestBody() override {}
  void read_pages();
  void read_page(live::Subscriber& page, std::string& into) const;

  live::RobotTexts texts_{loop, station};
  api::LiveParts parts_{loop, tasks, clock, station, live, texts_, "0.1.0"};
  live::Subscriber all_{loop}, watcher_{loop};
  std::string heard_by_all_, heard_by_watcher_;
  std::vector<std::unique_ptr<TestRobot>> robots_;
  bool is_finished_ = false;
};

}  // namespace server
