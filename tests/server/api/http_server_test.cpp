// HTTP over real loopback sockets: good manners, and every kind of bad ones.
#include "server/http/http_connection.hpp"
#include "server/net/transport_security.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class HttpServerTest : public ApiTest {
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
  // Redeems a login link as its page does when the button is pressed.
  std::string redeem(const std::string& url, const std::string& extra = "") {
    const std::string body = json{{"code", url.substr(url.find("code=") + 5)}}.dump();
    return talk("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + extra +
                "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body);
  }
  void expect_alive() { EXPECT_TRUE(get("/api/v1/station").starts_with("HTTP/1.1 200 ")); }
};

bool contains(const std::string& answer, const std::string& part) { return answer.find(part) != std::string::npos; }

constexpr const char* kSecurityHeaders[] = {
    "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; ",
    "; font-src 'self'; connect-src 'self'",
    "; base-uri 'none'; form-action 'self'; frame-ancestors 'none'\r\n",
    "X-Content-Type-Options: nosniff\r\n",
    "X-Frame-Options: DENY\r\n",
    "Referrer-Policy: no-referrer\r\n",
    "Cross-Origin-Opener-Policy: same-origin\r\n",
    "Cross-Origin-Resource-Policy: same-origin\r\n",
    "Permissions-Policy: accelerometer=(), camera=(),",
    "Cache-Control: no-store\r\n"};

TEST_F(HttpServerTest, AnswersWithSecurityHeaders) {
  const std::string answer = get("/api/v1/robots");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 OK\r\n")) << answer;
  for (const char* header : kSecurityHeaders) EXPECT_TRUE(contains(answer, header)) << header;
  EXPECT_TRUE(contains(answer, "Content-Type: application/json"));
  EXPECT_TRUE(answer.ends_with("{\"robots\":[]}")) << answer;
}

TEST_F(HttpServerTest, EveryErrorHasTheSecurityHeaders) {
  const std::string late = "GET / HTTP/1.1\r\nHost: loc";
  for (const std::string& request :
       {std::string{"GET /api/v1/robots HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"},
        std::string{"GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n"},
        std::string{"nonsense\r\n\r\n"}, head("GET /nothing", "Connection: close\r\n"),
        head("GET /%2e%2e/", "Connection: close\r\n"), head("PUT /api/v1/robots", "Connection: close\r\n"),
        head("GET /api/v1/runs/1", "Connection: close\r\n"), head("POST /api/v1/runs", "Content-Length: 100000\r\n"),
        late}) {
    RawClient client{clock, port()};
    client.send(request);
    if (request == late) clock.run_for(11s);
    const std::string answer = client.read_to_end();
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 4")) << answer;
    EXPECT_TRUE(contains(answer, "Content-Type: application/problem+json\r\n")) << answer;
    for (const char* header : kSecurityHeaders) EXPECT_TRUE(contains(answer, header)) << header << answer;
  }
}

TEST_F(HttpServerTest, ThePolicyNamesTheOriginOfLiveAndNothingThatAHostSmugglesIn) {
  EXPECT_TRUE(contains(get("/api/v1/robots"), "connect-src 'self' ws://localhost; base-uri"));
  const std::string smuggled = talk("GET / HTTP/1.1\r\nHost: localhost:1; script-src *\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(contains(smuggled, "connect-src 'self'; base-uri")) << smuggled;
  EXPECT_FALSE(contains(smuggled, "script-src *"));
}

TEST_F(HttpServerTest, WhatHoldsDataOrSetsACookieIsNotCached) {
  connect_robot();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "long"}});
  for (const char* target : {"/metrics", "/api/v1/runs", "/api/v1/runs/1/samples.csv", "/api/v1/openapi.yaml"}) {
    const std::string answer = get(target);
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 200")) << answer;
    EXPECT_TRUE(contains(answer, "Cache-Control: no-")) << target;
  }
  const std::string in = redeem(login_url());
  EXPECT_TRUE(contains(in, "Set-Cookie: ") && contains(in, "Cache-Control: no-store\r\n")) << in;
}

TEST_F(HttpServerTest, KeepsTheConnectionAndTakesPipelinedRequests) {
  RawClient client{clock, port()};
  client.send(head("GET /api/v1/robots") + head("GET /api/v1/robots"));
  client.read_until("{\"robots\":[]}");
  EXPECT_TRUE(client.read_until("{\"robots\":[]}").starts_with("HTTP/1.1 200"));
  client.send(head("GET /api/v1/robots"));
  EXPECT_TRUE(client.read_until("{\"robots\":[]}").starts_with("HTTP/1.1 200"));
  EXPECT_FALSE(client.closed());
}

TEST_F(HttpServerTest, HeadHasNoBody) {
  const std::string answer = talk(head("HEAD /api/v1/robots", "Connection: close\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200"));
  EXPECT_TRUE(contains(answer, "Content-Length: 13\r\n")) << answer;
  EXPECT_TRUE(answer.ends_with("\r\n\r\n")) << answer;
}

TEST_F(HttpServerTest, NoTokenIs401) {
  const std::string answer = talk("GET /api/v1/robots HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 401 Unauthorized")) << answer;
  EXPECT_TRUE(contains(answer, "WWW-Authenticate: Bearer"));
  EXPECT_TRUE(contains(answer, "application/problem+json"));
}

TEST_F(HttpServerTest, TheLoginLinkGivesACookieOnce) {
  const std::string url = login_url();
  EXPECT_TRUE(redeem(url, "Origin: http://evil.example\r\n").starts_with("HTTP/1.1 403")) << "and is not used up";
  const std::string answer = redeem(url, "Origin: http://localhost\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200")) << answer;
  EXPECT_TRUE(contains(answer, "; HttpOnly; SameSite=Strict; Path=/"));
  const std::string again = redeem(url);
  EXPECT_TRUE(again.starts_with("HTTP/1.1 401") && contains(again, "\"bad_link\"")) << again;
  const auto begin = answer.find("rheonaut_session_fedcba9876543210=");
  const std::string cookie = answer.substr(begin, answer.find(';', begin) - begin);
  const std::string with_cookie =
      talk("GET /api/v1/robots HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nCookie: " + cookie + "\r\n\r\n");
  EXPECT_TRUE(with_cookie.starts_with("HTTP/1.1 200")) << with_cookie;
}

TEST_F(HttpServerTest, WhoIsInMakesALinkForAnotherPageAndALookDoesNotUseItUp) {
  const std::string made = talk(head("POST /api/v1/login-links", "Connection: close\r\n"));
  ASSERT_TRUE(made.starts_with("HTTP/1.1 201 ")) << made;
  const json link = json::parse(made.substr(made.find("\r\n\r\n")));
  EXPECT_EQ(link["expires_at_us"], clock.utc_us() + 600'000'000);
  const std::string url = link["url"];
  ASSERT_TRUE(url.starts_with("http://localhost/login?code=")) << url;
  const std::string rest =
      " " + url.substr(url.find("/login")) + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  for (const char* method : {"HEAD", "GET", "GET"}) {
    const std::string page = talk(method + rest);
    EXPECT_TRUE(page.starts_with("HTTP/1.1 200 ") && !contains(page, "Set-Cookie")) << page;
  }
  EXPECT_TRUE(redeem(url).starts_with("HTTP/1.1 200 "));
  const std::string post = "POST /api/v1/login-links HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  EXPECT_TRUE(talk(post).starts_with("HTTP/1.1 401 "));
}

TEST_F(HttpServerTest, RefusesAWrongHost) {
  const std::string answer = talk("GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 421")) << answer;
  EXPECT_TRUE(talk("GET / HTTP/1.1\r\nConnection: close\r\n\r\n").starts_with("HTTP/1.1 421"));
}

TEST_F(HttpServerTest, MalformedHttpIs400AndTheEnd) {
  for (const char* bytes :
       {"hello\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "GET / HTTP/1.1\r\nno colon\r\n\r\n",
        "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 this is TLS\r\n\r\n",
        "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: x\r\n\r\n"}) {
    EXPECT_TRUE(talk(bytes).starts_with("HTTP/1.1 400 ")) << bytes;
  }
  expect_alive();
}

TEST_F(HttpServerTest, RefusesABigBodyWithoutReadingIt) {
  RawClient client{clock, port()};
  client.send(head("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 10485760\r\n"));
  EXPECT_TRUE(client.read_until("\r\n").starts_with("HTTP/1.1 413 "));
  expect_alive();
}

TEST_F(HttpServerTest, ABigBodyIsReadToItsEndSoThatTheAnswerArrives) {
  for (const char* length : {"Content-Length: 10485760\r\n", "Transfer-Encoding: chunked\r\n"}) {
    RawClient client{clock, port()};
    const bool chunked = std::string_view{length}.starts_with("Transfer");
    client.send(head("POST /api/v1/runs", std::string{"Content-Type: application/json\r\n"} + length));
    EXPECT_TRUE(client.send((chunked ? "a00000\r\n" : "") + std::string(10 * 1024 * 1024, ' '))) << length;
    EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 413 ")) << length;
  }
  expect_alive();
}

TEST_F(HttpServerTest, RefusesABigHeader) {
  const std::string answer = talk(head("GET /api/v1/robots", "X-Filler: " + std::string(20'000, 'x') + "\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 431 ")) << answer;
}

TEST_F(HttpServerTest, RefusesALongTargetAndTooManyFields) {
  const std::string target = get("/api/v1/robots?x=" + std::string(8200, 'x'));
  EXPECT_TRUE(target.starts_with("HTTP/1.1 414 ")) << target;
  std::string fields;
  for (std::size_t i = 0; i < http::kMaxHeaderFields; ++i) fields += "X-" + std::to_string(i) + ": 1\r\n";
  const std::string answer = talk(head("GET /api/v1/robots", fields));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 431 ")) << answer;
  expect_alive();
}

TEST_F(HttpServerTest, ACallerWithoutTheRightIsRefusedBeforeItsBodyArrives) {
  const struct {
    const char* head;
    const char* status;
  } cases[] = {
      {"POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 60000\r\n\r\n", "401"},
      {"POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n", "401"},
      {"POST / HTTP/1.1\r\nHost: evil.example\r\nContent-Length: 60000\r\n\r\n", "421"},
      {"POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: "
       "5000\r\n\r\n",
       "413"},
      {"POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nExpect: 100-continue\r\nContent-Length: 10\r\n\r\n", "401"},
  };
  for (const auto& one : cases) {
    RawClient client{clock, port()};
    client.send(one.head);
    EXPECT_TRUE(client.read_until("\r\n").starts_with(std::string{"HTTP/1.1 "} + one.status)) << one.head;
    EXPECT_TRUE(contains(client.read_until("\r\n\r\n"), "Connection: close"));
  }
  RawClient drips{clock, port()};
  drips.send(
      "POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nTransfer-Encoding: "
      "chunked\r\n\r\n1400\r\n" +
      std::string(5120, ' '));
  EXPECT_TRUE(drips.read_until("\r\n").starts_with("HTTP/1.1 413 "));
  expect_alive();
}

TEST_F(HttpServerTest, ASlowHeaderEndsAfterTenSeconds) {
  RawClient client{clock, port()};
  client.send("GET / HTTP/1.1\r\nHost: loc");
  clock.run_for(9s);
  EXPECT_FALSE(client.closed());
  clock.run_for(2s);
  EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 408 "));
}

TEST_F(HttpServerTest, ASlowBodyEndsAfterTenSecondsAlsoWhenItDrips) {
  RawClient client{clock, port()};
  client.send(head("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 100\r\n") + "{");
  for (int i = 0; i < 11; ++i) {
    client.send(" ");
    clock.run_for(1s);
  }
  EXPECT_TRUE(client.read_to_end().starts_with("HTTP/1.1 408 "));
}

TEST_F(HttpServerTest, AnIdleConnectionEndsAfterAMinute) {
  RawClient client{clock, port()};
  client.send(head("GET /api/v1/robots"));
  client.read_until("{\"robots\":[]}");
  clock.run_for(59s);
  EXPECT_FALSE(client.closed());
  clock.run_for(3s);
  EXPECT_TRUE(client.closed());
}

TEST_F(HttpServerTest, LetsAWaitingClientContinue) {
  RawClient client{clock, port()};
  client.send(
      head("POST /api/v1/runs", "Content-Type: application/json\r\nContent-Length: 2\r\nExpect: 100-continue\r\n"));
  EXPECT_EQ(client.read_until("\r\n\r\n"), "HTTP/1.1 100 Continue\r\n\r\n");
  client.send("{}");
  EXPECT_TRUE(client.read_until("\r\n").starts_with("HTTP/1.1 400 "));
}

TEST_F(HttpServerTest, TheWrongContentTypeIs415) {
  const std::string answer =
      talk(head("POST /api/v1/runs", "Content-Type: text/plain\r\nContent-Length: 2\r\nConnection: close\r\n") + "{}");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 415 ")) << answer;
}

TEST_F(HttpServerTest, UnknownPathsEndNowhere) {
  for (const char* target : {"/api/v1/nothing", "/nothing", "/rheonaut.token", "//etc/passwd", "/.git/config",
                             "/assets/", "/assets", "/index.html/", "/station.sqlite"}) {
    EXPECT_TRUE(get(target).starts_with("HTTP/1.1 404 ")) << target;
  }
}

// The page's files are in the program, so there is no folder to climb out of; a path that tries is refused all the
// same.
TEST_F(HttpServerTest, APathThatClimbsIsRefusedInEveryDisguise) {
  for (const char* target : {"/../rheonaut.token",
                             "/..",
                             "/.",
                             "/./rheonaut.token",
                             "/%2e%2e/rheonaut.token",
                             "/%2E%2E/rheonaut.token",
                             "/.%2e/rheonaut.token",
                             "/assets/../../rheonaut.token",
                             "/assets/..%2f..%2frheonaut.token",
                             "/assets/..%5c..%5crheonaut.token",
                             "/assets/%5c%5c.%5crheonaut.token",
                             "/%2fetc/passwd",
                             "/assets/%00",
                             "/a%00.js",
                             "/%0d%0aSet-Cookie:%20a=b",
                             "/%c0%ae%c0%ae%2frheonaut.token",
                             "/%",
                             "/%2",
                             "/%zz",
                             "*",
                             "etc/passwd",
                             "http://localhost/../rheonaut.token",
                             "/api/v1/../../rheonaut.token",
                             "/api/v1/runs/..%2f..%2f/samples"}) {
    const std::string answer = get(target);
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 400 ")) << target << answer;
    EXPECT_FALSE(contains(answer, token()));
  }
  // Twice encoded, it is a name like any other, of nothing. A backslash is refused by Beast or by the router.
  EXPECT_TRUE(get("/%252e%252e/rheonaut.token").starts_with("HTTP/1.1 404 "));
  EXPECT_TRUE(get("/assets/..\\..\\rheonaut.token").starts_with("HTTP/1.1 400 "));
  EXPECT_TRUE(talk("GET /a\x01 HTTP/1.1\r\nHost: localhost\r\n\r\n").starts_with("HTTP/1.1 400 "));
}

TEST_F(HttpServerTest, ThePageComesWithoutCredential) {
  const std::string answer = talk("GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
  EXPECT_TRUE(contains(answer, "Content-Type: text/html"));
}

TEST_F(HttpServerTest, AFileThatTheClientHasIs304) {
  const std::string first = get("/api/v1/openapi.yaml");
  const auto begin = first.find("ETag: ") + 6;
  const std::string etag = first.substr(begin, first.find("\r\n", begin) - begin);
  const std::string second =
      talk(head("GET /api/v1/openapi.yaml", "If-None-Match: " + etag + "\r\nConnection: close\r\n"));
  EXPECT_TRUE(second.starts_with("HTTP/1.1 304 ")) << second;
  EXPECT_TRUE(second.ends_with("\r\n\r\n"));
}

TEST_F(HttpServerTest, CsvIsChunkedOrEndsWithTheConnection) {
  connect_robot();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "long"}});
  for (std::uint64_t seq = 0; seq < 5000; seq += 25) make_samples(*robot, seq, 25);
  const std::string chunked = get("/api/v1/runs/1/samples.csv");
  EXPECT_TRUE(contains(chunked, "Transfer-Encoding: chunked\r\n"));
  EXPECT_TRUE(contains(chunked, "Z,4999,0,0,0,0,0,manual,none,,0,"));
  EXPECT_TRUE(chunked.ends_with("\r\n0\r\n\r\n"));
  const std::string plain = talk(
      "GET /api/v1/runs/1/samples.csv HTTP/1.0\r\nHost: localhost\r\nAuthorization: Bearer " + token() + "\r\n\r\n");
  EXPECT_FALSE(contains(plain, "Transfer-Encoding"));
  EXPECT_TRUE(contains(plain.substr(plain.size() - 200), "Z,4999,0,0,0,0,0,manual,none,,0,"));
  const std::string head_only = talk(head("HEAD /api/v1/runs/1/samples.csv", "Connection: close\r\n"));
  EXPECT_TRUE(head_only.starts_with("HTTP/1.1 200 ")) << head_only;
  EXPECT_TRUE(head_only.ends_with("\r\n\r\n")) << head_only;
}

// Whatever an answer has of a body, the next one begins where it ends.
TEST_F(HttpServerTest, AnswersOfAllKindsFollowOneAnother) {
  connect_robot();
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "short"}});
  make_samples(*robot, 0, 25);
  const std::string file = get("/api/v1/openapi.yaml");
  const auto begin = file.find("ETag: ") + 6;
  const std::string etag = file.substr(begin, file.find("\r\n", begin) - begin);
  RawClient client{clock, port()};
  client.send(head("HEAD /api/v1/runs/1/samples.csv") + head("GET /api/v1/runs/1/samples.csv") +
              head("GET /api/v1/openapi.yaml", "If-None-Match: " + etag + "\r\n") + head("GET /live") +
              head("GET /api/v1/robots", "Connection: close\r\n"));
  const std::string said = client.read_to_end();
  std::vector<std::string> statuses;
  for (auto at = said.find("HTTP/1.1 "); at != std::string::npos; at = said.find("HTTP/1.1 ", at + 1)) {
    const bool after_the_one_before = at == 0 || said[at - 1] == '\n' || said[at - 1] == '}';
    EXPECT_TRUE(after_the_one_before) << said.substr(at - 1, 40);
    statuses.push_back(said.substr(at + 9, 3));
  }
  EXPECT_EQ(statuses, (std::vector<std::string>{"200", "200", "304", "426", "200"})) << said;
}

TEST_F(HttpServerTest, SilentConnectionsDoNotKeepAStopOut) {
  connect_robot();
  RawClient known{clock, port()};  // the oldest, but it has shown the token
  known.send(head("GET /api/v1/station"));
  known.read_until("}");
  std::vector<std::unique_ptr<RawClient>> silent;
  for (std::size_t i = 1; i < security.http().limiter.limits().of_loopback + 40; ++i) {
    silent.push_back(std::make_unique<RawClient>(clock, port()));
  }
  RawClient person{clock, port()};
  person.send(head("POST /api/v1/robots/r1/emergency-stop"));
  ASSERT_EQ(robot->commands().size(), 1U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 99);
  clock.settle();
  EXPECT_TRUE(person.read_until("\r\n").starts_with("HTTP/1.1 200 "));
  EXPECT_TRUE(silent.front()->closed());
  EXPECT_FALSE(silent.back()->closed());
  EXPECT_FALSE(known.closed());
}

TEST_F(HttpServerTest, StopsWithConnectionsOpen) {
  RawClient client{clock, port()};
  client.send("GET / HT");
  tasks.stop();
  clock.settle();
  EXPECT_TRUE(client.closed());
}

}  // namespace
}  // namespace server
