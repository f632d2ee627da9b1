// Query parameters are taken as they are meant, or refused by name.
#include "server/api/bodies/query_params.hpp"

#include <gtest/gtest.h>

namespace server {
namespace {

http::Request with(std::map<std::string, std::string> query) {
  http::Request request;
  request.query = std::move(query);
  request.param["robot_id"] = "r1";
  request.param["run_id"] = "7";
  return request;
}

TEST(QueryParams, ChannelsAreNamesWithCommas) {
  EXPECT_EQ(api::query_channels(with({})), storage::all_channels());
  EXPECT_EQ(api::query_channels(with({{"channels", "position_m"}})), storage::Channels{0b000001});
  EXPECT_EQ(api::query_channels(with({{"channels", "reference_m,duty"}})), storage::Channels{0b101000});
  for (const char* text : {"", ",", "duty,", ",duty", "duty,duty", "duty;velocity_m_s", "Duty", " duty", "voltage"}) {
    const auto refused = api::query_channels(with({{"channels", text}}));
    ASSERT_FALSE(refused.has_value()) << text;
    EXPECT_EQ(refused.error().code, ErrorCode::bad_request);
    EXPECT_NE(refused.error().detail.find("channels"), std::string::npos);
  }
}

TEST(QueryParams, AWindowHasItsEndAboveItsBeginning) {
  EXPECT_FALSE(api::query_window(with({})).value().has_value());
  const auto both = api::query_window(with({{"from_us", "5"}, {"to_us", "6"}})).value();
  EXPECT_EQ(both->from_us, 5);
  EXPECT_EQ(both->to_us, 6);
  EXPECT_EQ(api::query_window(with({{"to_us", "6"}})).value()->from_us, 0);
  EXPECT_GT(api::query_window(with({{"from_us", "6"}})).value()->to_us, 2'000'000'000'000'000);
  EXPECT_EQ(api::query_window(with({{"from_us", "6"}, {"to_us", "6"}})).error().code, ErrorCode::bad_request);
  EXPECT_EQ(api::query_window(with({{"from_us", "-1"}})).error().code, ErrorCode::bad_request);
  EXPECT_EQ(api::query_window(with({{"to_us", "1e6"}})).error().code, ErrorCode::bad_request);
  EXPECT_EQ(api::query_window(with({{"to_us", "99999999999999999999"}})).error().code, ErrorCode::bad_request);
}

TEST(QueryParams, ACursorIsOneThatAPageGave) {
  EXPECT_FALSE(api::query_cursor(with({})).value().has_value());
  EXPECT_EQ(api::query_cursor(with({{"after", api::cursor_text(storage::SampleCursor{3, 99})}})).value()->seq, 99u);
  for (const char* text : {"", "3", "3-", "-3", "3-4-", "3-99999999999999999999", "3-18446744073709551615"}) {
    EXPECT_EQ(api::query_cursor(with({{"after", text}})).error().code, ErrorCode::bad_request) << text;
  }
}

TEST(QueryParams, AnExcerptIsARunOrARobot) {
  const storage::Excerpt run = api::run_excerpt(with({})).value();
  EXPECT_EQ(run.run, 7);
  EXPECT_FALSE(run.window.has_value());
  const storage::Excerpt robot = api::robot_excerpt(with({{"from_us", "1"}})).value();
  EXPECT_FALSE(robot.run.has_value());
  EXPECT_EQ(robot.robot_id, "r1");
  EXPECT_EQ(robot.window->from_us, 1);
  http::Request unknown = with({});
  unknown.param["run_id"] = "x";
  EXPECT_EQ(api::run_excerpt(unknown).error().code, ErrorCode::bad_request);
}

}  // namespace
}  // namespace server
