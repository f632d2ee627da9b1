// The trailers of a chunked request are no part of its header: nobody is let in, sent elsewhere or upgraded by them.
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

constexpr const char* kRun = R"({"robot_id":"r1","name":"long"})";

class TrailersTest : public ApiTest {
 protected:
  static std::string chunked(const std::string& body, const std::string& trailers) {
    return fmt::format("{:x}\r\n{}\r\n0\r\n{}\r\n", body.size(), body, trailers);
  }
  std::string bearer() const { return "Authorization: Bearer " + token() + "\r\n"; }
  static std::string head(const std::string& request_line, const std::string& fields) {
    return request_line + " HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n" + fields +
           "Transfer-Encoding: chunked\r\n\r\n";
  }
  // The answer, and whether another request on the same connection is answered.
  std::pair<std::string, bool> answer_and_next(const std::string& request) {
    RawClient client{clock, port()};
    client.send(request);
    const std::string answer = client.read_until("\r\n\r\n");
    client.send("GET /api/v1/station HTTP/1.1\r\nHost: localhost\r\n" + bearer() + "Connection: close\r\n\r\n");
    return {answer, client.read_to_end().find("HTTP/1.1 200 OK\r\n") != std::string::npos};
  }
};

TEST_F(TrailersTest, ARequestWithTrailersIsCarriedOut) {
  connect_robot();
  const auto [answer, goes_on] =
      answer_and_next(head("POST /api/v1/runs", bearer()) + chunked(kRun, "Checksum: 1\r\nX-Other: 2\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 201 ")) << answer;
  EXPECT_TRUE(goes_on);
}

TEST_F(TrailersTest, ACredentialInATrailerLetsNobodyIn) {
  connect_robot();
  const auto [answer, goes_on] = answer_and_next(head("POST /api/v1/runs", "") + chunked(kRun, bearer()));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 401 ")) << answer;
  EXPECT_EQ(ask("GET", "/api/v1/runs").parsed()["runs"], json::array());
}

TEST_F(TrailersTest, NeitherConnectionNorHostInATrailerHolds) {
  connect_robot();
  const auto [answer, goes_on] = answer_and_next(
      head("POST /api/v1/runs", bearer()) +
      chunked(kRun, "Host: evil.example\r\nOrigin: http://evil.example\r\nCookie: a=b\r\nConnection: close\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 201 ")) << answer;
  EXPECT_EQ(answer.find("evil.example"), std::string::npos) << answer;
  EXPECT_EQ(answer.find("Connection: close"), std::string::npos) << answer;
  EXPECT_TRUE(goes_on);
}

TEST_F(TrailersTest, TheContentTypeInATrailerIsNotThatOfTheBody) {
  const std::string request = "POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\n" + bearer() +
                              "Content-Type: text/plain\r\nTransfer-Encoding: chunked\r\n\r\n";
  const auto [answer, goes_on] = answer_and_next(request + chunked(kRun, "Content-Type: application/json\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 415 ")) << answer;
}

TEST_F(TrailersTest, AnUpgradeInTrailersIsNone) {
  const std::string upgrade =
      "Connection: upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
  RawClient client{clock, port()};
  client.send(head("GET /live", bearer()) + chunked("", upgrade).substr(std::string_view{"0\r\n\r\n"}.size()));
  const std::string answer = client.read_until("\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 4")) << answer;
}

// What frames a message stands in its header alone (RFC 9110, 6.5.1): the request is refused, or its successor is read.
TEST_F(TrailersTest, AFramingFieldInATrailerDoesNotFrameWhatFollows) {
  connect_robot();
  for (const char* field : {"Content-Length: 500\r\n", "Transfer-Encoding: chunked\r\n"}) {
    const auto [answer, goes_on] =
        answer_and_next(head("POST /api/v1/robots/r1/markers", bearer()) + chunked(R"({"text":"a"})", field));
    const bool is_refused =
        answer.starts_with("HTTP/1.1 400 ") && answer.find("Connection: close") != std::string::npos;
    EXPECT_EQ(is_refused, !goes_on) << field << answer;
  }
}

}  // namespace
}  // namespace server
