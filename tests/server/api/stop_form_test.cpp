// An emergency stop over a real socket, in every form that a program may give it: only who asks, and from where, is
// judged.
#include "server/http/http_connection.hpp"
#include "server/identity/accounts.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

constexpr const char* kStop = "/api/v1/robots/r1/emergency-stop";
constexpr const char* kStopAll = "/api/v1/emergency-stop";

class StopFormTest : public ApiTest {
 protected:
  StopFormTest() { connect_robot(); }

  std::string bearer() const { return "Authorization: Bearer " + token() + "\r\n"; }
  std::string cookie() {
    const std::string secret = accounts().open_session("", "127.0.0.1", "");
    return "Cookie: rheonaut_session_fedcba9876543210=" + secret + "\r\n";
  }
  static std::string post(const std::string& target, const std::string& headers) {
    return "POST " + target + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
  }
  std::size_t stops() const { return robot->commands().size(); }

  // The robot has the stop at once, and its answer reaches the client.
  void expect_stop(RawClient& client, const std::string& request) {
    const std::size_t before = stops();
    client.send(request);
    ASSERT_EQ(stops(), before + 1) << request.substr(0, 400);
    EXPECT_EQ(robot->commands().back().which_action, rheonaut_Command_emergency_stop_tag);
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, ++latch_);
    clock.settle();
    head_ = client.read_until("\r\n\r\n");
    EXPECT_TRUE(head_.starts_with("HTTP/1.1 200 ")) << head_;
    const auto length = head_.find("Content-Length: ") + 16;
    body_ = client.read_exactly(std::stoul(head_.substr(length)));
  }
  void expect_stop(const std::string& request) {
    RawClient client{clock, port()};
    expect_stop(client, request);
  }
  // Nothing reaches the robot.
  void expect_refused(const std::string& request, const std::string& status) {
    const std::size_t before = stops();
    RawClient client{clock, port()};
    client.send(request);
    const std::string answer = client.read_until("\r\n");
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 " + status + " ")) << request << answer;
    EXPECT_EQ(stops(), before) << request;
  }
  bool closes() const { return head_.find("Connection: close") != std::string::npos; }

  std::string head_, body_;  // of the latest answer

 private:
  std::uint64_t latch_ = 0;
};

TEST_F(StopFormTest, AnyContentTypeIsAsGoodAsNone) {
  for (const char* target : {kStop, kStopAll}) {
    expect_stop(post(target, bearer()));
    for (const char* type : {"application/x-www-form-urlencoded", "text/plain", "multipart/form-data; boundary=x",
                             "application/json", "nonsense", ""}) {
      const std::string content = std::string{"Content-Type: "} + type + "\r\nContent-Length: 9\r\n";
      expect_stop(post(target, bearer() + content) + "reason=on");
    }
  }
}

TEST_F(StopFormTest, ABodyThatIsNoJsonIsIgnored) {
  for (const std::string& body : {std::string{"{"}, std::string{"null"}, std::string("\0\xff\r\n\r\n", 6)}) {
    const std::string content = "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size());
    expect_stop(post(kStop, bearer() + content + "\r\n") + body);
  }
}

TEST_F(StopFormTest, WhateverIsInTheQueryIsIgnored) {
  for (const char* target : {kStop, kStopAll}) {
    for (const std::string& query : {std::string{"?wait=verified"}, std::string{"?"}, std::string{"?a=1&a=1&%zz"},
                                     "?" + std::string(http::kMaxTargetBytes, 'x')}) {
      expect_stop(post(target + query, bearer()));
    }
  }
}

TEST_F(StopFormTest, ASlashAtTheEndIsIgnored) {
  expect_stop(post(std::string{kStop} + "/", bearer()));
  expect_stop(post(std::string{kStopAll} + "/", bearer()));
  expect_stop(post(std::string{kStopAll} + "/?now", bearer()));
  expect_refused(post(std::string{kStopAll} + "//", bearer()), "404");
  expect_refused(post("/api/v1/robots//", bearer()), "404");
}

TEST_F(StopFormTest, ManyHeaderFieldsAreIgnored) {
  std::string fields;
  for (std::size_t i = 0; i < http::kMaxHeaderFields + 20; ++i) fields += "X-" + std::to_string(i) + ": 1\r\n";
  expect_stop(post(kStop, bearer() + fields));
}

// The size of a head is bounded also when it asks for a stop (docs/api.md).
TEST_F(StopFormTest, AHeadOf15kBIsObeyedAndOneOfMoreThan16kBRefusedInWords) {
  const auto head_of = [this](std::size_t bytes) {
    const std::size_t others = post(kStop, bearer() + "X-Long: \r\n").size();
    return post(kStop, bearer() + "X-Long: " + std::string(bytes - others, 'x') + "\r\n");
  };
  expect_stop(head_of(15 * 1024));
  RawClient client{clock, port()};
  client.send(head_of(http::kMaxHeaderBytes + 1024));
  const std::string answer = client.read_until("bytes");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 431 ")) << answer;
  EXPECT_TRUE(answer.ends_with("the header has more than 16384 bytes")) << answer;
  EXPECT_EQ(stops(), 1U);
}

TEST_F(StopFormTest, ActsBeforeTheBodyHasArrived) {
  RawClient client{clock, port()};
  expect_stop(client, post(kStop, bearer() + "Content-Length: 10\r\n"));
  EXPECT_FALSE(closes());
  client.send("0123456789");
  expect_stop(client, post(kStop, bearer()));  // the body was passed over, and no more
}

TEST_F(StopFormTest, DoesNotWaitForABodyThatNeverComes) {
  for (const char* body : {"Content-Length: 10\r\n", "Transfer-Encoding: chunked\r\n"}) {
    RawClient client{clock, port()};
    expect_stop(client, post(kStop, bearer() + body) + "5\r\nabc");
    clock.run_for(http::kRequestTime + 2s);
    EXPECT_TRUE(client.closed()) << "and nothing is said twice";
  }
}

TEST_F(StopFormTest, AChunkedBodyIsPassedOver) {
  RawClient client{clock, port()};
  expect_stop(client, post(kStop, bearer() + "Transfer-Encoding: chunked\r\n") + "5\r\nab");
  client.send("cde\r\n3;x=y\r\nfgh\r\n0\r\nTrailer: x\r\n\r\n");
  expect_stop(client, post(kStop, bearer()));
}

TEST_F(StopFormTest, AfterALargeBodyTheConnectionEnds) {
  RawClient client{clock, port()};
  expect_stop(client, post(kStop, bearer() + "Content-Length: 100000\r\n") + std::string(30'000, 'x'));
  EXPECT_TRUE(closes());
  EXPECT_TRUE(json::parse(body_).contains("command_id")) << body_;
  clock.run_for(http::kLingerTime + 2s);
  EXPECT_TRUE(client.closed());
}

TEST_F(StopFormTest, AChunkedBodyThatGrowsTooLargeEndsTheConnection) {
  RawClient client{clock, port()};
  expect_stop(client, post(kStop, bearer() + "Transfer-Encoding: chunked\r\n"));
  client.send("20000\r\n" + std::string(0x20000, 'x') + "\r\n0\r\n\r\n" + post(kStop, bearer()));
  clock.run_for(http::kLingerTime + 2s);
  EXPECT_TRUE(client.closed());
  EXPECT_EQ(stops(), 1U);
}

// curl asks first when its body is large. Told what became of the stop, it may send the body or not: so nothing after
// the answer is taken for a request.
TEST_F(StopFormTest, IsNotHeldUpByAClientThatAsksWhetherItMaySend) {
  RawClient client{clock, port()};
  expect_stop(client, post(kStop, bearer() + "Expect: 100-continue\r\nContent-Length: 2000\r\n"));
  EXPECT_TRUE(closes());
  client.send(post(kStop, bearer()));
  clock.run_for(http::kLingerTime + 2s);
  EXPECT_TRUE(client.closed());
  EXPECT_EQ(stops(), 1U);
}

// What is in a body is never a request, however little of it has been read when the stop is answered.
TEST_F(StopFormTest, ARequestInABodyIsNotCarriedOut) {
  const std::string hidden = post("/api/v1/robots/r1/emergency-stop", bearer());
  const std::string length = "Content-Length: " + std::to_string(hidden.size()) + "\r\n";
  RawClient whole{clock, port()};
  expect_stop(whole, post(kStop, bearer() + length) + hidden);
  EXPECT_EQ(stops(), 1U);
  RawClient later{clock, port()};
  expect_stop(later, post(kStop, bearer() + length));
  later.send(hidden);
  EXPECT_EQ(stops(), 2U);
  RawClient large{clock, port()};
  expect_stop(large, post(kStop, bearer() + "Content-Length: 100000\r\n"));
  large.send(hidden);
  EXPECT_EQ(stops(), 3U);
}

TEST_F(StopFormTest, AHeadWhoseFramingIsAmbiguousIsRefused) {
  for (const char* lengths :
       {"Content-Length: 3\r\nContent-Length: 5\r\n", "Content-Length: 3, 5\r\n", "Content-Length: many\r\n",
        "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n", "Transfer-Encoding: chunked\r\nContent-Length: 3\r\n",
        "Transfer-Encoding: gzip\r\n", "Transfer-Encoding: chunked, gzip\r\n"}) {
    expect_refused(post(kStop, bearer() + lengths) + "{}\r\n0\r\n\r\n", "400");
  }
}

TEST_F(StopFormTest, WhoAsksIsJudgedAsEver) {
  const std::string form = "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 3\r\n";
  expect_refused(post(kStop, form) + "a=b", "401");
  expect_refused(post(kStop, "Authorization: Bearer wrong\r\n"), "401");
  expect_refused("POST " + std::string{kStop} + " HTTP/1.1\r\nHost: evil.example\r\n" + bearer() + form + "\r\na=b",
                 "421");
  expect_refused(post("/api/v1/robots/r2/emergency-stop", bearer() + form) + "a=b", "404");
  expect_refused("GET " + std::string{kStop} + "/ HTTP/1.1\r\nHost: localhost\r\n" + bearer() + "\r\n", "405");
}

// The cookie comes along with a form of any page, which needs no leave for such a content type.
TEST_F(StopFormTest, AFormOfAnotherPageStopsNothingByTheCookie) {
  const std::string in = cookie();
  for (const char* type : {"text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"}) {
    const std::string form = std::string{"Content-Type: "} + type + "\r\nContent-Length: 3\r\n";
    for (const char* from :
         {"", "Origin: null\r\n", "Origin: http://evil.example\r\n", "Origin: http://localhost:1\r\n",
          "Sec-Fetch-Site: cross-site\r\n", "Sec-Fetch-Site: same-site\r\n", "Sec-Fetch-Site: none\r\n",
          "Origin: http://evil.example\r\nSec-Fetch-Site: same-origin\r\n"}) {
      for (const char* target : {kStop, kStopAll}) expect_refused(post(target, in + form + from) + "a=b", "403");
    }
  }
}

TEST_F(StopFormTest, ByTheCookieTheStationsOwnPageStops) {
  const std::string form = "Content-Type: text/plain\r\nContent-Length: 3\r\n";
  const std::string in = cookie();
  expect_stop(post(kStop, in + form + "Origin: http://localhost\r\n") + "a=b");
  expect_stop(post(kStop, in + form + "Sec-Fetch-Site: same-origin\r\n") + "a=b");
}

TEST_F(StopFormTest, ByATokenItNeedsNoOriginButNotAnothers) {
  const std::string form = "Content-Type: text/plain\r\nContent-Length: 3\r\n";
  expect_stop(post(kStop, bearer() + form) + "a=b");
  expect_stop(post(kStop, bearer() + form + "Origin: http://localhost\r\n") + "a=b");
  expect_refused(post(kStop, bearer() + form + "Origin: http://evil.example\r\n") + "a=b", "403");
}

TEST_F(StopFormTest, AKeyStillMakesTwoRequestsOneStop) {
  const std::string request = post(kStop, bearer() + "Idempotency-Key: press-1\r\nContent-Length: 2\r\n") + "{}";
  RawClient client{clock, port()};
  expect_stop(client, request);
  const std::string first = json::parse(body_)["command_id"];
  client.send(request);
  client.read_until("\r\n\r\n");
  EXPECT_TRUE(client.read_until(first).ends_with(first));
  EXPECT_EQ(stops(), 1U);
  expect_stop(post(kStop, bearer() + "Idempotency-Key: no key at all\r\n"));
}

}  // namespace
}  // namespace server
