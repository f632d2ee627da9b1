// Heads of requests that two programs could read differently, over real loopback sockets.
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class HttpHeadTest : public ApiTest {
 protected:
  std::string head(const std::string& request_line, const std::string& extra = "") const {
    return request_line + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token() + "\r\n" + extra + "\r\n";
  }
  // Sends one request and reads until the station closes.
  std::string talk(const std::string& bytes) {
    RawClient client{clock, port()};
    client.send(bytes);
    return client.read_to_end();
  }
  std::string get(const std::string& target) { return talk(head("GET " + target, "Connection: close\r\n")); }
};

bool contains(const std::string& answer, const std::string& part) { return answer.find(part) != std::string::npos; }

// A line that begins with a blank may be read as a field of its own by another program; so may a second Host.
TEST_F(HttpHeadTest, FoldedLinesAndTwoHostsAre400) {
  connect_robot();
  for (const char* extra : {"X-Note: a\r\n Content-Length: 3\r\n", "X-Note: a\r\n\tb\r\n", "Host: localhost\r\n",
                            "Host: evil.example\r\n"}) {
    for (const char* target : {"POST /api/v1/runs", "POST /api/v1/emergency-stop"}) {
      const std::string answer = talk(head(target, extra));
      EXPECT_TRUE(answer.starts_with("HTTP/1.1 400 ")) << extra << answer;
    }
  }
  EXPECT_TRUE(robot->commands().empty());
  EXPECT_TRUE(get("/api/v1/station").starts_with("HTTP/1.1 200 "));
}

// Two lengths, or a length and chunks, read differently by two programs on the way, hide a second request.
TEST_F(HttpHeadTest, TwoLengthsAre400) {
  for (const char* lengths : {"Content-Length: 3\r\nContent-Length: 5\r\n", "Content-Length: 3, 5\r\n",
                              "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n",
                              "Transfer-Encoding: chunked\r\nContent-Length: 3\r\n", "Transfer-Encoding: gzip\r\n"}) {
    const std::string answer = talk(head("POST /api/v1/runs", lengths) + "{}\r\n0\r\n\r\n");
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 400 ")) << lengths << answer;
  }
}

// However the head is cut into pieces on its way.
TEST_F(HttpHeadTest, AHeadInPiecesIsReadAsOne) {
  for (const std::size_t piece : {1U, 7U, 100U}) {
    RawClient client{clock, port()};
    const std::string request = head("GET /api/v1/robots", "Connection: close\r\n");
    for (std::size_t i = 0; i < request.size(); i += piece) {
      client.send(request.substr(i, piece));
      clock.settle();
    }
    EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 200 ")) << piece;
  }
}

TEST_F(HttpHeadTest, AFoldedLineIsRefusedWhereverTheHeadIsCut) {
  const std::string folded = head("GET /api/v1/robots", "X-Note: a\r\n Content-Length: 3\r\n");
  for (std::size_t cut = 1; cut < folded.size(); ++cut) {
    RawClient client{clock, port()};
    client.send(folded.substr(0, cut));
    clock.settle();
    client.send(folded.substr(cut));
    EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 400 ")) << cut;
  }
}

TEST_F(HttpHeadTest, TheHostOfATargetInTheAbsoluteFormStandsForTheHeader) {
  EXPECT_TRUE(get("http://localhost:1/api/v1/robots").starts_with("HTTP/1.1 200 "));
  EXPECT_TRUE(get("http://evil.example/api/v1/robots").starts_with("HTTP/1.1 421 "));
  EXPECT_TRUE(talk("GET HTTP://localhost HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n")
                  .starts_with("HTTP/1.1 200 "));
}

TEST_F(HttpHeadTest, ABodyInACodingThatIsNotKnownIs415) {
  const std::string body = R"({"robot_id":"r1","name":"long"})";
  const std::string json =
      "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) + "\r\nConnection: close\r\n";
  connect_robot();
  EXPECT_TRUE(contains(talk(head("POST /api/v1/runs", json + "Content-Encoding: gzip\r\n") + body),
                       "\"wrong_content_encoding\""));
  EXPECT_TRUE(
      talk(head("POST /api/v1/runs", json + "Content-Encoding: identity\r\n") + body).starts_with("HTTP/1.1 201 "));
}

TEST_F(HttpHeadTest, ABodyOfAnotherTypeIsRefusedBeforeItComes) {
  for (const char* of_body :
       {"Content-Type: text/plain\r\n", "", "Content-Type: application/json\r\nContent-Encoding: gzip\r\n"}) {
    const std::string answer =
        talk(head("POST /api/v1/runs", std::string{of_body} + "Content-Length: 60000\r\nExpect: 100-continue\r\n"));
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 415 ")) << of_body << answer;
  }
}

TEST_F(HttpHeadTest, AMemberThatIsGivenTwiceIs400) {
  connect_robot();
  for (const char* body :
       {R"({"robot_id":"r1","name":"a","name":"b"})", R"({"robot_id":"r1","na\u006de":"a","name":"b"})"}) {
    const std::string answer =
        talk(head("POST /api/v1/runs", fmt::format("Content-Type: application/json\r\nContent-Length: {}\r\n"
                                                   "Connection: close\r\n",
                                                   std::string_view{body}.size())) +
             body);
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 400 ")) << answer;
    EXPECT_TRUE(contains(answer, "\"repeated_member\"")) << answer;
    EXPECT_TRUE(contains(answer, "name")) << answer;
  }
}

// Were it set again later, the answer to one tab could put an old session in the place of the newer one of another tab.
TEST_F(HttpHeadTest, TheCookieIsSetBySigningInAndByNothingElse) {
  const std::string url = login_url(), body = json{{"code", url.substr(url.find("code=") + 5)}}.dump();
  const std::string in =
      talk(head("POST /api/v1/login", fmt::format("Connection: close\r\nContent-Type: application/json"
                                                  "\r\nContent-Length: {}\r\n",
                                                  body.size())) +
           body);
  const std::string name = "rheonaut_session_fedcba9876543210=";
  const auto begin = in.find("Set-Cookie: " + name) + 12;
  ASSERT_LT(begin, in.size()) << in;
  const std::string cookie = in.substr(begin, in.find(';', begin) - begin);
  EXPECT_TRUE(contains(in, "Set-Cookie: " + cookie + "; HttpOnly; SameSite=Strict; Path=/; Max-Age=34560000\r\n"))
      << in;
  for (const char* target : {"/api/v1/me", "/api/v1/station", "/"}) {
    const std::string answer = talk(
        fmt::format("GET {} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nCookie: {}\r\n\r\n", target, cookie));
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
    EXPECT_FALSE(contains(answer, "Set-Cookie")) << answer;
  }
}

}  // namespace
}  // namespace server
