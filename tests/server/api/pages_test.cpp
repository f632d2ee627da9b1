// Every list that comes in pages, walked page by page while it grows: nothing comes twice, nothing is lost.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <functional>
#include <set>

#include "server/http/router.hpp"
#include "tests/server/api/api_fixture.hpp"
#include "tests/server/api/openapi_document.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;
using Keys = std::vector<std::string>;

constexpr int kAtFirst = 4;  // of each list, or more

struct List {
  std::string pattern, target;
  const char* cursor;         // before: newest first; after: oldest first
  const char* member;         // of a page, with the items
  const char* key;            // of an item; null: the item itself
  std::function<void()> add;  // one more
};

class PagesTest : public ApiTest {
 protected:
  PagesTest() {
    connect_robot();
    for (const std::uint64_t seq : {0U, 30U, 40U, 50U, 60U}) send(seq, seq == 0 ? 25 : 5);
    for (int i = 0; i < kAtFirst; ++i) {
      for (const List& list : lists) list.add();
    }
  }

  void send(std::uint64_t first_seq, pb_size_t count) {
    robot->send_samples(first_seq, count, 1'000'000 + first_seq * 10'000, 0);
    clock.settle();
  }
  void post(const std::string& target, const json& body, int status = 201) {
    const Answered answered = ask("POST", "/api/v1" + target, body);
    EXPECT_EQ(answered.status, status) << target << ": " << answered.body;
  }
  void add_run() {
    post("/runs", {{"robot_id", "r1"},
                   {"name", "afterwards"},
                   {"span", {{"boot_id", "77"}, {"first_seq", 0}, {"last_seq", 64}}}});
  }
  void add_marker() { post("/robots/r1/markers", {{"text", "here"}}); }
  void mark_end_of_run() {
    const json samples = ask("GET", "/api/v1/runs/1/samples?limit=1000").parsed()["samples"];
    post("/robots/r1/markers", {{"text", "the end"}, {"at_us", samples.back()["utc_us"]}});
  }
  void add_command() {
    const auto asked = begin("POST", "/api/v1/robots/r1/commands", {{"kind", "ping"}});
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
    EXPECT_EQ(end(asked).status, 200);
  }
  void change_control() {
    clock.run_for(1ms);  // its events differ by their time alone
    const bool is_held = !station.holder("r1").empty();
    post("/robots/r1/control", {{"action", is_held ? "release" : "take"}}, 200);
  }
  void add_job() { post("/jobs", {{"kind", "report"}, {"runs", {1}}}, 202); }
  void add_design() {
    const json model{{"kp", 0.1}, {"b1", 0.0057}, {"b2", 0.11}, {"alpha", 1.7}, {"beta", 0.87}};
    post("/designs", {{"kind", "model"}, {"name", "one more"}, {"document", model}});
  }
  void add_experiment() {
    const json profile{{"name", "rest"},
                       {"purpose", "nothing moves"},
                       {"conditions", {{"start", "here"}}},
                       {"step", {{{"kind", "rest"}, {"for_s", 5}}}}};
    post("/experiments", {{"robot_id", "r1"}, {"profile", profile}}, 202);
  }
  void add_reservation() {
    const std::int64_t from_us = clock.utc_us() + 1'000'000'000 * ++reservations_;
    post("/robots/r1/reservations", {{"from_us", from_us}, {"for_s", 60}});
  }
  void add_samples() {
    send(next_seq_, 5);
    next_seq_ += 10;
  }
  // All of its positions come at once, with the first call.
  void add_positions() {
    if (ask("GET", "/api/v1/runs/1/reference").status == 200) return;
    std::string csv = "t_s,position_m\n";
    for (int k = 0; k < 60; ++k) csv += fmt::format("{},{}\n", k / 100.0, 0.001 * k);
    post("/runs/1/reference", {{"csv", csv},
                               {"source", "camera.csv"},
                               {"sd_m", 0.0005},
                               {"keep_zero", true},
                               {"clock", {{"method", "offset"}, {"offset_s", 0.01}}}});
  }

  static std::string key_of(const List& list, const json& item) {
    return list.key == nullptr ? item.dump() : item.at(list.key).dump();
  }
  // With something added after the first page, if there is another one.
  Keys walk(const List& list, int limit, bool grows) {
    Keys found;
    std::string cursor;
    for (int pages = 0;; ++pages) {
      const Answered answered = ask("GET", fmt::format("{}?limit={}{}", list.target, limit, cursor));
      EXPECT_EQ(answered.status, 200) << list.target << cursor << ": " << answered.body;
      if (answered.status != 200) return found;
      const json page = answered.parsed();
      EXPECT_LE(page[list.member].size(), static_cast<std::size_t>(limit)) << list.pattern;
      for (const json& item : page[list.member]) found.push_back(key_of(list, item));
      const json& next = page["next"];
      if (next.is_null()) return found;
      cursor = fmt::format("&{}={}", list.cursor, next.is_string() ? next.get<std::string>() : next.dump());
      if (!grows || pages > 0) continue;
      clock.run_for(1ms);
      list.add();
    }
  }

  std::vector<List> lists{
      {"/api/v1/runs", "/api/v1/runs", "before", "runs", "run_id", [this] { add_run(); }},
      {"/api/v1/robots/{robot_id}/markers", "/api/v1/robots/r1/markers", "after", "markers", "marker_id",
       [this] { add_marker(); }},
      {"/api/v1/runs/{run_id}/markers", "/api/v1/runs/1/markers", "after", "markers", "marker_id",
       [this] { mark_end_of_run(); }},
      {"/api/v1/robots/{robot_id}/commands", "/api/v1/robots/r1/commands", "before", "commands", "command_id",
       [this] { add_command(); }},
      {"/api/v1/robots/{robot_id}/events", "/api/v1/robots/r1/events", "before", "events", nullptr,
       [this] { change_control(); }},
      {"/api/v1/audit", "/api/v1/audit", "before", "entries", "entry", [this] { change_control(); }},
      {"/api/v1/jobs", "/api/v1/jobs", "before", "jobs", "job_id", [this] { add_job(); }},
      {"/api/v1/designs", "/api/v1/designs", "before", "designs", "design_id", [this] { add_design(); }},
      {"/api/v1/experiments", "/api/v1/experiments", "before", "experiments", "experiment_id",
       [this] { add_experiment(); }},
      {"/api/v1/reservations", "/api/v1/reservations", "before", "reservations", "reservation_id",
       [this] { add_reservation(); }},
      {"/api/v1/runs/{run_id}/reference/positions", "/api/v1/runs/1/reference/positions", "after", "robot_time_us",
       nullptr, [this] { add_positions(); }},
      {"/api/v1/robots/{robot_id}/samples", "/api/v1/robots/r1/samples", "after", "samples", "seq",
       [this] { add_samples(); }},
      {"/api/v1/robots/{robot_id}/gaps", "/api/v1/robots/r1/gaps", "after", "missing", "first_seq",
       [this] { add_samples(); }},
      {"/api/v1/runs/{run_id}/samples", "/api/v1/runs/1/samples", "after", "samples", "seq", [this] { add_samples(); }},
      {"/api/v1/runs/{run_id}/gaps", "/api/v1/runs/1/gaps", "after", "missing", "first_seq", [this] { add_samples(); }},
  };

 private:
  std::int64_t reservations_ = 0;
  std::uint64_t next_seq_ = 70;
};

TEST_F(PagesTest, EachListIsWalkedWithNothingTwiceAndNothingLost) {
  for (const List& list : lists) {
    const Keys whole = walk(list, 1000, false);
    ASSERT_GE(whole.size(), static_cast<std::size_t>(kAtFirst)) << list.pattern;
    for (const int limit : {1, 3}) {
      const Keys before = walk(list, 1000, false);
      Keys paged = walk(list, limit, true);
      EXPECT_EQ(std::set(paged.begin(), paged.end()).size(), paged.size()) << list.pattern << ": twice";
      const bool is_newest_first = list.cursor == std::string{"before"};
      if (!is_newest_first && paged.size() > before.size()) paged.resize(before.size());  // what was added comes last
      EXPECT_EQ(paged, before) << list.pattern << " by " << limit;
    }
  }
}

TEST_F(PagesTest, AnExactlyFullPageIsTheLast) {
  for (const List& list : lists) {
    const std::size_t all = walk(list, 1000, false).size();
    const json page = ask("GET", fmt::format("{}?limit={}", list.target, all)).parsed();
    EXPECT_EQ(page["next"], nullptr) << list.pattern;
  }
}

TEST_F(PagesTest, ACursorThatNoPageGaveIsRefusedAndTheAnswerSaysWhatToDo) {
  for (const List& list : lists) {
    for (const char* bad : {"x", "-1", "1-", "1-2-3-4", "99999999999999999999", ""}) {
      const Answered refused = ask("GET", fmt::format("{}?{}={}", list.target, list.cursor, bad));
      EXPECT_EQ(refused.status, 400) << list.pattern << " " << bad << ": " << refused.body;
      EXPECT_EQ(refused.parsed()["reason"], "out_of_range") << list.pattern;
      EXPECT_THAT(refused.parsed()["detail"].get<std::string>(), HasSubstr("leave it out for the first page"));
    }
  }
}

// A new list has to be walked, too.
TEST_F(PagesTest, EveryRouteWithALimitIsOneOfThemInOneStyle) {
  std::map<std::string, std::string> walked;
  for (const List& list : lists) walked[list.pattern] = list.cursor;
  const json document = openapi_document();
  std::size_t found = 0;
  for (const http::Route& route : router().routes()) {
    if (std::ranges::find(route.query, "limit") == route.query.end()) continue;
    ++found;
    const std::string cursor = walked[route.pattern];
    for (const char* name : {"before", "after"}) {
      const bool is_taken = std::ranges::find(route.query, name) != route.query.end();
      EXPECT_EQ(is_taken, cursor == name) << route.pattern << " " << name;
    }
    const json& answer = document["paths"][route.pattern]["get"]["responses"]["200"]["content"]["application/json"];
    const std::string schema = answer["schema"]["$ref"].get<std::string>().substr(1);
    EXPECT_THAT(document.at(json::json_pointer{schema})["required"], ::testing::Contains("next")) << route.pattern;
  }
  EXPECT_EQ(found, lists.size());
}

}  // namespace
}  // namespace server
