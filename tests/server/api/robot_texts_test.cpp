// All robots as text: bounded pieces, kept texts, and pages that open in front of a fleet while it changes.
#include "server/live/robot_texts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <functional>
#include <map>

#include "server/live/state_json.hpp"
#include "tests/server/api/live_page.hpp"

namespace server {
namespace {

namespace asio = boost::asio;

std::string name_of(std::size_t number) { return fmt::format("r{:04}", number); }

std::vector<station::RestoredRobot> fleet_of(std::size_t size) {
  std::vector<station::RestoredRobot> fleet;
  for (std::size_t i = 0; i < size; ++i) fleet.push_back({.id = name_of(i), .boot_id = i + 1, .emergency_id = 0});
  return fleet;
}

class RobotTextsTest : public ::testing::Test {
 public:
  ~RobotTextsTest() override {
    tasks.stop();
    clock.settle();
  }

 protected:
  void restore(std::size_t size) { station.restore(fleet_of(size), {}); }
  // The pieces of all robots, from the first to the end.
  std::vector<live::RobotTexts::Piece> pieces() {
    std::vector<live::RobotTexts::Piece> all;
    do all.push_back(texts.piece_after(all.empty() ? "" : all.back().last));
    while (!all.back().is_end);
    return all;
  }
  asio::awaitable<void> read(std::string& into) {
    live::RobotDocument document{texts, "[", "]"};
    while (!document.is_whole()) into += co_await document.next();
  }
  std::string read_all() {
    std::string text;
    tasks.spawn("reader", read(text));
    clock.settle();
    return text;
  }

  asio::io_context loop{1};
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  station::Station station{loop, clock, config::Envelope{}, config::LinkTimes{}};
  live::RobotTexts texts{loop, station};
};

TEST_F(RobotTextsTest, APieceIsABoundedPieceOfWork) {
  restore(500);
  const auto first = pieces();
  EXPECT_EQ(texts.written(), 500U);
  EXPECT_GE(first.size(), 500 / live::RobotTexts::kWrittenInAPiece) << "each text of a piece had to be written";
  std::size_t largest_text = 0;
  for (const auto& [id, robot] : station.robots())
    largest_text = std::max(largest_text, base::dump(live::to_json(robot)).size());
  const auto second = pieces();
  EXPECT_EQ(texts.written(), 500U);
  EXPECT_LT(second.size(), first.size()) << "nothing had to be written";
  for (const auto& piece : second) EXPECT_LE(piece.text.size(), live::RobotTexts::kPieceBytes + largest_text);
}

TEST_F(RobotTextsTest, ATextIsWrittenAgainWhenItsStateHasChangedAndThenOnly) {
  restore(50);
  EXPECT_EQ(texts.written(), 0U) << "nobody has read";
  read_all();
  read_all();
  EXPECT_EQ(texts.written(), 50U);
  ASSERT_TRUE(station.set_fluid(name_of(20), "water", {"token:local", "", 0}));
  station.on_durable(name_of(30), 31, 4711, 0);  // of which no sink is notified
  const json list = json::parse(read_all());
  EXPECT_EQ(texts.written(), 52U);
  EXPECT_EQ(list[20]["fluid"], "water");
  EXPECT_EQ(list[30]["durable_next_seq"], 4711);
}

TEST_F(RobotTextsTest, ADocumentHasEveryRobotOnceAndIsJsonWithNoneToo) {
  EXPECT_EQ(read_all(), "[]");
  restore(1);
  EXPECT_EQ(json::parse(read_all()).size(), 1U);
  restore(333);
  for (int i = 0; i < 2; ++i) {
    const json list = json::parse(read_all());
    ASSERT_EQ(list.size(), 333U);
    for (std::size_t robot = 0; robot < list.size(); ++robot) EXPECT_EQ(list[robot]["robot_id"], name_of(robot));
  }
}

// However many pages open at once, whatever else is ready comes between one piece and the next.
TEST_F(RobotTextsTest, ATurnOfTheLoopMakesOnePieceHoweverManyRead) {
  restore(200);
  std::vector<std::string> into(20);
  for (std::string& text : into) tasks.spawn("reader", read(text));
  std::vector<std::uint64_t> seen;
  std::function<void()> step = [&] {
    seen.push_back(texts.written());
    if (texts.written() < 200) asio::post(loop, step);
  };
  asio::post(loop, step);
  clock.settle();
  ASSERT_GE(seen.size(), 200 / live::RobotTexts::kWrittenInAPiece);
  for (std::size_t i = 1; i < seen.size(); ++i) EXPECT_LE(seen[i] - seen[i - 1], live::RobotTexts::kWrittenInAPiece);
  for (const std::string& text : into) EXPECT_EQ(json::parse(text).size(), 200U);
  EXPECT_EQ(texts.written(), 200U) << "each once, for all of them";
}

// A robot that comes while somebody reads, before and behind where that one is.
TEST_F(RobotTextsTest, RobotsMayAppearBetweenTwoPieces) {
  restore(40);
  const live::RobotTexts::Piece first = texts.piece_after("");
  ASSERT_FALSE(first.is_end);
  station.restore({{.id = "a-first", .boot_id = 1, .emergency_id = 0}}, {});
  station.restore({{.id = "z-last", .boot_id = 1, .emergency_id = 0}}, {});
  std::string rest;
  for (live::RobotTexts::Piece piece = first; !piece.is_end;) {
    piece = texts.piece_after(piece.last);
    rest += (rest.empty() ? "" : ",") + piece.text;
  }
  const json all = json::parse("[" + first.text + "," + rest + "]");
  EXPECT_EQ(all.size(), 41U);
  EXPECT_EQ(all.back()["robot_id"], "z-last");
}

class OpeningPageTest : public ApiTest {
 protected:
  static constexpr std::size_t kFleet = 300;

  std::string bearer() const { return "Authorization: Bearer " + token() + "\r\n"; }
  // Each robot is stopped, which pages hear at once, and some turns later somebody takes control of it, which they hear
  // with the next stamp. A robot in each turn of the loop, the last one first: the welcome comes towards them.
  asio::awaitable<void> change_everything() {
    constexpr std::size_t kLater = 7;
    for (std::size_t turn = 0; turn < kFleet + kLater; ++turn) {
      if (turn < kFleet) tasks.spawn("stop", stop(name_of(kFleet - 1 - turn)));
      if (turn >= kLater) {
        const station::ControlRequest take{
            name_of(kFleet - 1 - (turn - kLater)), "session:7", "", station::ControlAction::take, 60s, "", 0us};
        EXPECT_TRUE(station.control(take));
      }
      co_await asio::post(loop, asio::use_awaitable);
    }
    has_changed = true;
  }
  asio::awaitable<void> stop(station::RobotId id) {
    station::StopRequest request;
    request.robot_id = std::move(id);
    request.actor = "session:7";
    co_await station.emergency_stop(std::move(request), 0us);
  }

  bool has_changed = false;
};

int stage_of(const json& state) {
  return (state["pending_stop"].is_null() ? 0 : 1) + (state["control"].is_null() ? 0 : 2);
}

TEST_F(OpeningPageTest, NothingIsLostBetweenTheWelcomeAndTheFirstChangeAndNothingGoesBack) {
  station.restore(fleet_of(kFleet), {});
  Page page{clock, port(), bearer(), "127.0.0.1", [&] { tasks.spawn("changes", change_everything()); }};
  ASSERT_TRUE(page.open()) << page.answer;
  const json welcome = page.receive("welcome");
  ASSERT_TRUE(has_changed);
  ASSERT_EQ(welcome["robots"].size(), kFleet);
  std::map<std::string, int> received;
  std::size_t in_the_welcome = 0;
  for (const json& robot : welcome["robots"]) {
    const int stage = received[robot["robot_id"]] = stage_of(robot);
    in_the_welcome += stage > 0 ? 1 : 0;
  }
  EXPECT_GT(in_the_welcome, 0U) << "it changed while the page opened,";
  EXPECT_LT(in_the_welcome, kFleet) << "also behind what had been written";
  const auto knows_all = [&] {
    return std::ranges::all_of(received, [](const auto& robot) { return robot.second == 3; });
  };
  for (int stamp = 0; stamp < 10 && !knows_all(); ++stamp) {
    clock.run_for(100ms);
    for (json message = page.next(); message.is_object() && message["type"] != "stamp"; message = page.next()) {
      if (message["type"] != "robot") continue;
      int& stage = received[message["robot"]["robot_id"]];
      const int newer = stage_of(message["robot"]);
      EXPECT_EQ(stage & ~newer, 0) << message["robot"]["robot_id"] << " went back";
      stage = newer;
    }
  }
  EXPECT_TRUE(knows_all());
}

TEST_F(OpeningPageTest, TheListOfAFleetIsOneDocumentInPieces) {
  station.restore(fleet_of(kFleet), {});
  const Answered answered = ask("GET", "/api/v1/robots");
  EXPECT_NE(answered.response.stream, nullptr);
  EXPECT_EQ(answered.parsed()["robots"].size(), kFleet);
  RawClient client{clock, port()};
  client.send("GET /api/v1/robots HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + bearer() + "\r\n");
  const std::string head = client.read_until("\r\n\r\n");
  EXPECT_TRUE(head.starts_with("HTTP/1.1 200")) << head;
  EXPECT_NE(head.find("Transfer-Encoding: chunked\r\n"), std::string::npos) << head;
  EXPECT_TRUE(client.read_to_end().ends_with("]}\r\n0\r\n\r\n"));
}

}  // namespace
}  // namespace server
