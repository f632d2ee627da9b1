// How the head of an answer is framed, and its fields for browsers.
#include "server/http/answer_head.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

namespace server {
namespace {

class NoStream : public http::BodyStream {
 public:
  boost::asio::awaitable<Result<std::optional<std::string>>> next() override { co_return std::nullopt; }
};

http::Response with_body(std::string body) {
  http::Response response;
  response.body = std::move(body);
  return response;
}

std::vector<std::string> lines_of(const std::string& head) {
  std::vector<std::string> lines;
  std::istringstream in{head};
  for (std::string line; std::getline(in, line);) {
    EXPECT_TRUE(line.ends_with('\r')) << line;
    lines.push_back(line.substr(0, line.size() - 1));
  }
  return lines;
}

// How many lines say the field, and what the last one says.
std::pair<int, std::string> field(const std::string& head, const std::string& name) {
  std::pair<int, std::string> found;
  for (const std::string& line : lines_of(head)) {
    if (!line.starts_with(name + ": ")) continue;
    ++found.first;
    found.second = line.substr(name.size() + 2);
  }
  return found;
}

using Field = std::pair<int, std::string>;
const Field kAbsent{0, ""};

TEST(AnswerHeadTest, EndsWithTheOneEmptyLine) {
  const auto lines = lines_of(answer_head(with_body("{}"), {.keep_alive = true}));
  EXPECT_EQ(lines.front(), "HTTP/1.1 200 OK");
  EXPECT_EQ(std::ranges::find(lines, ""), lines.end() - 1);
}

TEST(AnswerHeadTest, ABodyHasItsLength) {
  EXPECT_EQ(field(answer_head(with_body("12345"), {}), "Content-Length"), (Field{1, "5"}));
  EXPECT_EQ(field(answer_head(with_body(""), {}), "Content-Length"), (Field{1, "0"}));
}

// Its length would be that of the file which the client has.
TEST(AnswerHeadTest, AnAnswer304HasNoLength) {
  http::Response response;
  response.status = 304;
  const std::string head = answer_head(response, {.keep_alive = true});
  EXPECT_EQ(field(head, "Content-Length"), kAbsent);
  EXPECT_EQ(field(head, "Transfer-Encoding"), kAbsent);
}

TEST(AnswerHeadTest, OnlySomeAnswersHaveABody) {
  for (int status : {100, 101, 204, 304}) EXPECT_FALSE(http::may_have_body(status)) << status;
  for (int status : {200, 201, 303, 404, 503}) EXPECT_TRUE(http::may_have_body(status)) << status;
}

// RFC 9110, 7.8: who names a protocol to upgrade to, says so under Connection.
TEST(AnswerHeadTest, AnUpgradeIsNamedUnderConnection) {
  http::Response response;
  response.headers.emplace_back("Upgrade", "websocket");
  EXPECT_EQ(field(answer_head(response, {.keep_alive = true}), "Connection"), (Field{1, "upgrade"}));
  EXPECT_EQ(field(answer_head(response, {}), "Connection"), (Field{1, "close, upgrade"}));
}

TEST(AnswerHeadTest, AStreamIsChunkedAndInHttp10EndsWithItsConnection) {
  http::Response response;
  response.stream = std::make_unique<NoStream>();
  const std::string chunked = answer_head(response, {.keep_alive = true});
  EXPECT_EQ(field(chunked, "Transfer-Encoding"), (Field{1, "chunked"}));
  EXPECT_EQ(field(chunked, "Content-Length"), kAbsent);
  const std::string old = answer_head(response, {.version = 10});
  EXPECT_TRUE(old.starts_with("HTTP/1.0 200 OK\r\n"));
  EXPECT_EQ(field(old, "Transfer-Encoding"), kAbsent);
  EXPECT_EQ(field(old, "Content-Length"), kAbsent);
  EXPECT_EQ(field(old, "Connection"), (Field{1, "close"}));
}

TEST(AnswerHeadTest, SaysWhatBecomesOfTheConnectionWhereThatIsNotTheRule) {
  EXPECT_EQ(field(http::answer_head({}, {.keep_alive = true}), "Connection"), kAbsent);
  EXPECT_EQ(field(http::answer_head({}, {}), "Connection"), (Field{1, "close"}));
  EXPECT_EQ(field(http::answer_head({}, {.version = 10, .keep_alive = true}), "Connection"), (Field{1, "keep-alive"}));
}

TEST(AnswerHeadTest, NothingIsCachedUnlessTheResponseSaysSo) {
  http::Response response;
  EXPECT_EQ(field(answer_head(response, {}), "Cache-Control"), (Field{1, "no-store"}));
  response.headers.emplace_back("Cache-Control", "no-cache");
  response.headers.emplace_back("ETag", "\"1\"");
  EXPECT_EQ(field(answer_head(response, {}), "Cache-Control"), (Field{1, "no-cache"}));
  EXPECT_EQ(field(answer_head(response, {}), "ETag"), (Field{1, "\"1\""}));
}

// A Host of any other form would say more in the policy than the origin of /live.
TEST(AnswerHeadTest, ThePolicyNamesAPlainHostOnly) {
  const auto policy = [](const std::string& host, bool is_secure) {
    return field(http::answer_head({}, {.is_secure = is_secure, .host = host}), "Content-Security-Policy").second;
  };
  EXPECT_NE(policy("lab.local:8080", false).find("connect-src 'self' ws://lab.local:8080;"), std::string::npos);
  EXPECT_NE(policy("lab.local", true).find("connect-src 'self' wss://lab.local;"), std::string::npos);
  for (const char* host : {"", "a b", "a; script-src *", "a\r\nX: y", "{}", "[::1]"}) {
    EXPECT_NE(policy(host, false).find("connect-src 'self';"), std::string::npos) << host;
  }
}

TEST(AnswerHeadTest, OnlyTlsAsksForTlsNextTimeAndNotOfLocalhost) {
  const auto said = [](const std::string& host, bool is_secure) {
    return field(http::answer_head({}, {.is_secure = is_secure, .host = host}), "Strict-Transport-Security").first;
  };
  EXPECT_EQ(said("lab.local", true), 1);
  EXPECT_EQ(said("lab.local", false), 0);
  EXPECT_EQ(said("localhost:8443", true), 0);
}

TEST(AnswerHeadTest, TheLastAnswerIsWholeAndClosesTheConnection) {
  const std::string text = last_answer(with_body("gone"), false);
  EXPECT_TRUE(text.ends_with("\r\n\r\ngone"));
  EXPECT_NE(text.find("Connection: close\r\n"), std::string::npos);
  EXPECT_NE(text.find("Content-Length: 4\r\n"), std::string::npos);
}

}  // namespace
}  // namespace server
