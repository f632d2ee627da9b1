// Which changes of commands pages receive, and whose samples.
#include <gtest/gtest.h>

#include "server/live/live_feed.hpp"
#include "server/runtime/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

std::vector<json> messages_of(live::Subscriber& subscriber) {
  std::vector<json> all;
  for (live::LiveText text = subscriber.pop(); text != nullptr; text = subscriber.pop())
    all.push_back(json::parse(*text));
  return all;
}

// While somebody holds a duty its lease is renewed some ten times a second.
TEST(LiveLog, OfRenewalsOfLeasesOnlyARefusedOneIsSent) {
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  live::LiveFeed live{clock};
  tasks.spawn("live feed", live.run());
  live::Subscriber listener{loop};
  live.add(listener);
  const auto received = [&] { return messages_of(listener); };
  live::Subscriber filtered{loop};
  live.add(filtered);
  live.watch(filtered, {"r1"});
  station::CommandRecord renewal;
  renewal.robot_id = "r1";
  renewal.kind = "renew_lease";
  const auto renew = [&](station::CommandState end, const char* reason) {
    ++renewal.id;
    for (const station::CommandState state : {station::CommandState::queued, station::CommandState::sent, end}) {
      renewal.state = state;
      renewal.reason = state == end ? reason : "";
      live.on_command(renewal);
    }
  };
  for (int i = 0; i < 100; ++i) renew(station::CommandState::acknowledged, "");
  EXPECT_TRUE(received().empty());
  for (int i = 0; i < 10; ++i) renew(station::CommandState::rejected, "nothing_to_renew");
  const auto messages = received();
  ASSERT_EQ(messages.size(), 1U) << "once";
  EXPECT_EQ(messages[0]["command"]["state"], "rejected");
  renew(station::CommandState::failed, "link_lost");
  EXPECT_EQ(received().at(0)["command"]["reason"], "link_lost") << "for another reason";
  renew(station::CommandState::acknowledged, "");
  renew(station::CommandState::failed, "link_lost");
  EXPECT_EQ(received().size(), 1U) << "refused anew";
  renew(station::CommandState::unknown, "no_answer");
  EXPECT_EQ(received().at(0)["command"]["state"], "unknown") << "it may not have been renewed";
  clock.run_for(100ms);
  const auto logged = messages_of(filtered);
  ASSERT_EQ(logged.at(0)["type"], "log");
  EXPECT_EQ(logged[0]["commands"].size(), 4U);
  tasks.stop();
  clock.settle();
}

TEST(LiveLog, RobotsWhoseSamplesSomebodyGetsAreWatched) {
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  live::LiveFeed live{clock};
  live::Subscriber subscriber{loop};
  EXPECT_FALSE(live.watches("r1"));
  live.add(subscriber);
  EXPECT_TRUE(live.watches("r1")) << "who has named none gets those of all";
  live.watch(subscriber, {"r2", "r3"});
  EXPECT_FALSE(live.watches("r1"));
  EXPECT_TRUE(live.watches("r2"));
  live.watch(subscriber, {"r1"});
  EXPECT_TRUE(live.watches("r1"));
  EXPECT_FALSE(live.watches("r2"));
  live.remove(subscriber);
  EXPECT_FALSE(live.watches("r1"));
}

}  // namespace
}  // namespace server
