// The Foxglove protocol without a socket: what clients say, what they get, and what waits for a slow one.
#include "server/live/foxglove/feed.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;
using namespace live::foxglove;
using nlohmann::json;

std::string parsed(const std::string& text) {
  const auto message = parse_client_message(text);
  if (!message) return message.error();
  std::string out;
  if (const auto* subscribe = std::get_if<Subscribe>(&*message)) {
    for (const auto& entry : subscribe->subscriptions) {
      out += std::to_string(entry.id) + ":" + std::to_string(entry.channel) + " ";
    }
    return out;
  }
  for (const SubscriptionId id : std::get<Unsubscribe>(*message).subscriptions) out += "-" + std::to_string(id) + " ";
  return out;
}

TEST(FoxgloveClientMessage, SubscribesAndUnsubscribes) {
  EXPECT_EQ(parsed(R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":4294967295,"channelId":1}]})"),
            "0:3 4294967295:1 ");
  EXPECT_EQ(parsed(R"({"op":"unsubscribe","subscriptionIds":[0,7],"new_member":{}})"), "-0 -7 ");
}

TEST(FoxgloveClientMessage, SaysWhatIsWrong) {
  EXPECT_EQ(parsed("{"), "the message is not a JSON object, or is nested too deep");
  EXPECT_EQ(parsed("[]"), "the message is not a JSON object, or is nested too deep");
  EXPECT_EQ(parsed(std::string(60'000, '[')), "the message is not a JSON object, or is nested too deep");
  EXPECT_EQ(parsed(R"({"op":"subscribe","subscriptions":)" + std::string(20, '[') + std::string(20, ']') + "}"),
            "the message is not a JSON object, or is nested too deep");
  EXPECT_EQ(parsed(R"({"op":7})"), "the message has no op");
  EXPECT_EQ(parsed(R"({"op":"fly"})"), "the op 'fly' is not known");
  EXPECT_EQ(parsed(R"({"op":"subscribe","subscriptions":{}})"), "subscribe: subscriptions is not a list");
  const std::string no_id = "subscribe: an entry has no id and channelId from 0 to 4294967295";
  for (const char* entry : {"3", "{}", R"({"id":1})", R"({"id":-1,"channelId":1})", R"({"id":1.5,"channelId":1})",
                            R"({"id":"1","channelId":1})", R"({"id":1,"channelId":4294967296})"}) {
    EXPECT_EQ(parsed(R"({"op":"subscribe","subscriptions":[)" + std::string{entry} + "]}"), no_id) << entry;
  }
  EXPECT_EQ(parsed(R"({"op":"unsubscribe","subscriptionIds":["a"]})"),
            "unsubscribe: a subscription id is not a number from 0 to 4294967295");
}

TEST(FoxgloveClientMessage, ThereIsNothingToChangeAStationBy) {
  for (const char* op : {"advertise", "unadvertise", "setParameters", "getParameters", "fetchAsset"}) {
    EXPECT_EQ(parsed(json{{"op", op}}.dump()), std::string{op} + " is not possible: this connection only reads");
  }
  EXPECT_EQ(refusal_of_binary(std::string{"\x01\0\0\0\0hello", 10}),
            "publishing is not possible: this connection only reads");
  EXPECT_EQ(refusal_of_binary("\x02"), "a service call is not possible: this connection only reads");
  EXPECT_EQ(refusal_of_binary(""), "the binary opcode 0 is not known");
}

TEST(FoxgloveServerMessage, TheHeadOfMessageDataIsLittleEndian) {
  const DataHead head = data_head(0x01020304, 0x1112131415161718);
  EXPECT_EQ(std::memcmp(head.data(), "\x01\x04\x03\x02\x01\x18\x17\x16\x15\x14\x13\x12\x11", head.size()), 0);
}

station::RobotState robot(const std::string& id, std::int64_t retired_at_us = 0) {
  station::RobotState state;
  state.id = id;
  state.retired_at_us = retired_at_us;
  return state;
}

class FoxgloveSessionTest : public ::testing::Test {
 protected:
  // What waits for it; of message data its JSON.
  static std::vector<json> take(Session& session) {
    std::vector<json> all;
    while (const auto outgoing = session.queue().pop()) all.push_back(json::parse(*outgoing->body));
    return all;
  }
  static void subscribe(Session& session, ChannelId channel, SubscriptionId id) {
    session.on_text(json{{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", channel}}}}}.dump());
  }
  static station::SampleBatch batch(const std::string& id, std::size_t samples) {
    station::SampleBatch made;
    made.robot_id = id;
    made.boot_id = 77;
    made.first_seq = 10;
    made.first_robot_time_us = 100'000;
    made.utc_offset_us = 1'000'000;
    made.clock_uncertainty_us = 250;
    made.received_at_us = 1'200'000;
    made.context.period_us = 10'000;
    made.context.position_sd_m = 0.003F;
    made.samples.resize(samples);
    for (station::Sample& sample : made.samples) sample.position_m = 0.1F;
    return made;
  }
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  Feed feed;
};

TEST_F(FoxgloveSessionTest, HasTheTopicsOfAFileForOneRobotAndAPrefixForAll) {
  Session one{loop, clock, "sim-1"}, all{loop, clock, std::nullopt};
  for (Session* session : {&one, &all}) {
    session->begin("Rheonaut 1", "4711");
    feed.add(*session, {{"sim-1", robot("sim-1")}, {"sim-2", robot("sim-2")}, {"old", robot("old", 1)}});
  }
  const auto of_one = take(one);
  ASSERT_EQ(of_one.size(), 3U);
  EXPECT_EQ(
      of_one[0],
      (json{{"op", "serverInfo"}, {"name", "Rheonaut 1"}, {"capabilities", json::array()}, {"sessionId", "4711"}}));
  EXPECT_EQ(of_one[1], (json{{"op", "advertise"}, {"channels", json::array()}}));
  std::vector<std::string> topics;
  for (const json& channel : of_one[2]["channels"]) topics.push_back(channel["topic"]);
  EXPECT_EQ(topics, (std::vector<std::string>{"/telemetry", "/event", "/command"}));
  const json schema = json::parse(of_one[2]["channels"][0]["schema"].get<std::string>());
  EXPECT_NE(schema["properties"]["position_m"]["description"].get<std::string>().find("believed"), std::string::npos);
  EXPECT_EQ(schema["properties"]["position_sd_m"]["type"], "number");
  const auto of_all = take(all);
  ASSERT_EQ(of_all.size(), 4U) << "the retired robot has none";
  EXPECT_EQ(of_all[3]["channels"][0]["topic"], "/sim-2/telemetry");
  feed.remove(one), feed.remove(all);
}

TEST_F(FoxgloveSessionTest, RobotsComeAndAreRetiredAndComeBackWithNewChannels) {
  Session session{loop, clock, std::nullopt};
  feed.add(session, {});
  feed.on_robot(robot("sim-1"));
  feed.on_robot(robot("sim-1"));
  ASSERT_EQ(take(session).size(), 1U);
  subscribe(session, 1, 0);
  feed.on_samples(robot("sim-1"), batch("sim-1", 3));
  feed.on_robot(robot("sim-1", 1));
  EXPECT_EQ(take(session), (std::vector<json>{{{"op", "unadvertise"}, {"channelIds", {1, 2, 3}}}}))
      << "and nothing of it follows";
  feed.on_robot(robot("sim-1"));
  EXPECT_EQ(take(session)[0]["channels"][0]["id"], 4);
  feed.on_samples(robot("sim-1"), batch("sim-1", 1));
  EXPECT_TRUE(take(session).empty()) << "nobody has subscribed";
  feed.remove(session);
}

TEST_F(FoxgloveSessionTest, ASampleIsAMessageWithItsPositionAndItsDoubt) {
  Session session{loop, clock, "sim-1"};
  feed.add(session, {{"sim-1", robot("sim-1")}});
  take(session);
  subscribe(session, 1, 9);
  feed.on_samples(robot("sim-1"), batch("sim-1", 2));
  session.queue().pop();
  const auto second = session.queue().pop();
  ASSERT_TRUE(second && second->head);
  EXPECT_EQ(*second->head, data_head(9, 1'110'000'000));
  EXPECT_EQ(json::parse(*second->body),
            json::parse(R"({"boot_id":"77","seq":11,"robot_time_us":110000,"utc_us":1110000,"position_m":0.1,
    "velocity_m_s":0,"acceleration_m_s2":0,"duty":0,"impedance_mv":0,"reference_m":0,"mode":"unspecified",
    "sub_state":"none","disturbance_m":0,"position_sd_m":0.003,"controller_id":0,"emergency_id":"0",
    "emergency_cause":"none","flags":0,"clock_uncertainty_us":250,"first_received_at_us":1200000,
    "received_at_us":1200000})"));
  station::SampleBatch late = batch("sim-1", 5);
  late.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
  feed.on_samples(robot("sim-1"), late);
  EXPECT_TRUE(take(session).empty()) << "samples of the past are not live";
  feed.on_samples(robot("sim-2"), batch("sim-2", 5));
  EXPECT_TRUE(take(session).empty()) << "of another robot";
  session.on_text(R"({"op":"unsubscribe","subscriptionIds":[9]})");
  feed.on_samples(robot("sim-1"), batch("sim-1", 5));
  EXPECT_TRUE(take(session).empty());
  feed.remove(session);
}

TEST_F(FoxgloveSessionTest, AWrongSubscriptionIsAnsweredWithAStatus) {
  Session session{loop, clock, "sim-1"};
  feed.add(session, {{"sim-1", robot("sim-1")}});
  take(session);
  const auto refused = [&](ChannelId channel, SubscriptionId id) {
    subscribe(session, channel, id);
    const auto answers = take(session);
    return answers.empty() ? "" : answers[0]["message"].get<std::string>();
  };
  EXPECT_EQ(refused(4, 0), "subscribe: there is no channel 4");
  EXPECT_EQ(refused(1, 0), "");
  EXPECT_EQ(refused(1, 1), "subscribe: channel 1 has the subscription 0 already");
  EXPECT_EQ(refused(2, 0), "subscribe: the subscription id 0 is in use");
  session.on_text(R"({"op":"unsubscribe","subscriptionIds":[5]})");
  EXPECT_EQ(
      take(session),
      (std::vector<json>{{{"op", "status"}, {"level", 2}, {"message", "unsubscribe: there is no subscription 5"}}}));
  feed.remove(session);
}

TEST_F(FoxgloveSessionTest, TheFeedWatchesTheRobotsOfWhichATopicIsSubscribed) {
  Session session{loop, clock, std::nullopt};
  feed.add(session, {{"sim-1", robot("sim-1")}, {"sim-2", robot("sim-2")}});
  EXPECT_FALSE(feed.watches("sim-2"));
  subscribe(session, 5, 0);
  EXPECT_TRUE(feed.watches("sim-2")) << "of its events only";
  EXPECT_FALSE(feed.watches("sim-1"));
  session.on_text(R"({"op":"unsubscribe","subscriptionIds":[0]})");
  EXPECT_FALSE(feed.watches("sim-2"));
  feed.remove(session);
}

TEST_F(FoxgloveSessionTest, ASlowClientLosesTheOldestSamplesAndLearnsHowMany) {
  Session session{loop, clock, "sim-1"};
  feed.add(session, {{"sim-1", robot("sim-1")}});
  subscribe(session, 1, 0);
  for (int i = 0; i < 300; ++i) feed.on_samples(robot("sim-1"), batch("sim-1", 25));
  EXPECT_EQ(session.queue().size(), OutgoingQueue::kMaxData + 1) << "the channels are not lost";
  EXPECT_EQ(session.queue().dropped(), 7500 - OutgoingQueue::kMaxData);
  const std::string lost = std::to_string(7500 - OutgoingQueue::kMaxData);
  EXPECT_EQ(
      json::parse(*session.queue().pop()->body),
      (json{{"op", "status"},
            {"level", 1},
            {"id", "dropped"},
            {"message", lost + " messages were left out since the connection began: this client reads too slowly"}}));
  EXPECT_EQ(json::parse(*session.queue().pop()->body)["op"], "advertise");
  for (int i = 0; i < 10; ++i) feed.on_samples(robot("sim-1"), batch("sim-1", 25));
  EXPECT_TRUE(session.queue().pop()->head) << "the next status comes a second later";
  clock.run_for(1s);
  EXPECT_EQ(json::parse(*session.queue().pop()->body)["op"], "status");
  EXPECT_TRUE(session.queue().pop()->head);
  feed.remove(session);
}

TEST_F(FoxgloveSessionTest, WhatWaitsIsBoundedInBytesStatusesAndChannels) {
  OutgoingQueue queue{loop, clock};
  for (int i = 0; i < 100; ++i) queue.push_data(0, 0, shared(std::string(100'000, 'x')));
  EXPECT_LE(queue.size() * 100'000, OutgoingQueue::kMaxDataBytes);
  queue.drop(0);
  EXPECT_EQ(queue.size(), 0U);
  for (int i = 0; i < 1000; ++i) queue.push_status(StatusLevel::error, "no");
  EXPECT_EQ(queue.size(), OutgoingQueue::kMaxStatuses);
  for (int i = 0; i < 1000; ++i) queue.push_lasting("{}");
  EXPECT_EQ(queue.size(), OutgoingQueue::kMaxStatuses + OutgoingQueue::kMaxLasting);
  while (queue.pop()) {
  }
  EXPECT_TRUE(queue.is_overrun()) << "a channel is missing for good";
}

TEST_F(FoxgloveSessionTest, OfAFleetTheFirstRobotsAreShown) {
  Session session{loop, clock, std::nullopt};
  std::map<station::RobotId, station::RobotState> fleet;
  for (int i = 10; i < 40; ++i) fleet["r" + std::to_string(i)] = robot("r" + std::to_string(i));
  fleet["r39"].link = station::LinkState::connected;
  feed.add(session, fleet);
  const auto messages = take(session);
  ASSERT_EQ(messages.size(), Session::kMaxRobots + 1);
  EXPECT_EQ(messages[0]["channels"][0]["topic"], "/r39/telemetry") << "connected ones come first";
  EXPECT_EQ(messages.back()["message"],
            "only 16 robots are shown; ask for a link of one robot to see another, such as r25");
  feed.remove(session);
}

}  // namespace
}  // namespace server
