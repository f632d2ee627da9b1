// /foxglove over a real socket: who is let in, by what, and that it changes nothing.
#include "server/identity/accounts.hpp"
#include "server/identity/tickets.hpp"
#include "tests/server/api/live_page.hpp"

namespace server {
namespace {

config::Config with_foxglove() {
  config::Config config;
  config.foxglove = true;
  return config;
}

const std::string kProtocol = "Sec-WebSocket-Protocol: foxglove.sdk.v1, foxglove.websocket.v1\r\n";

class FoxgloveSocketTest : public ApiTest {
 public:
  FoxgloveSocketTest() : ApiTest{with_foxglove()} {}

 protected:
  // The path and query of a new link.
  std::string new_link(const json& body = nullptr) {
    const Answered made = ask("POST", "/api/v1/foxglove-links", body);
    EXPECT_EQ(made.status, 201) << made.body;
    const std::string url = made.parsed()["url"];
    return url.substr(url.find("/foxglove"));
  }
  std::unique_ptr<Page> open(const std::string& target, const std::string& headers = kProtocol) {
    return std::make_unique<Page>(clock, port(), headers, "127.0.0.1", [] {}, target);
  }
  static std::string ticket_of(const std::string& link) { return link.substr(link.find("ticket=") + 7); }
  json receive(Page& page, const std::string& op) {
    for (int i = 0; i < 50'000; ++i) {
      const auto text = page.next_text();
      if (!text) return nullptr;
      if (text->empty() || text->front() != '{') continue;  // message data
      json message = json::parse(*text);
      if (message["op"] == op) return message;
    }
    return nullptr;
  }
};

TEST_F(FoxgloveSocketTest, ATicketLetsInOnceWhateverTheOrigin) {
  connect_robot();
  const std::string link = new_link({{"robot_id", "r1"}});
  const auto page = open(link, kProtocol + "Origin: https://app.foxglove.dev\r\n");
  ASSERT_TRUE(page->open()) << page->answer;
  EXPECT_NE(page->answer.find("Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n"), std::string::npos);
  EXPECT_EQ(receive(*page, "serverInfo")["capabilities"], json::array());
  EXPECT_EQ(receive(*page, "advertise")["channels"], json::array());
  EXPECT_EQ(receive(*page, "advertise")["channels"][0]["topic"], "/telemetry");
  EXPECT_TRUE(open(link)->answer.starts_with("HTTP/1.1 401 ")) << "it was used";
}

TEST_F(FoxgloveSocketTest, ANewerClientIsAnsweredByItsOwnName) {
  const auto page = open(new_link(), "Sec-WebSocket-Protocol: foxglove.sdk.v2,foxglove.sdk.v1\r\n");
  ASSERT_TRUE(page->open()) << page->answer;
  EXPECT_NE(page->answer.find("Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n"), std::string::npos) << page->answer;
}

TEST_F(FoxgloveSocketTest, NothingElseLetsIn) {
  const std::string bearer = "Authorization: Bearer " + token() + "\r\n";
  const std::string session = accounts().open_session("", "", "");
  const std::string cookie = "Cookie: rheonaut_session_fedcba9876543210=" + session + "\r\n";
  ASSERT_TRUE(open("/live", cookie)->open()) << "it is a good cookie";
  for (const std::string& target : {std::string{"/foxglove"}, "/foxglove?ticket=" + token(),
                                    "/foxglove?ticket=" + session, std::string{"/foxglove?ticket="}}) {
    for (const std::string& headers : {std::string{}, bearer, cookie}) {
      EXPECT_TRUE(open(target, kProtocol + headers)->answer.starts_with("HTTP/1.1 401 ")) << target << headers;
    }
  }
}

TEST_F(FoxgloveSocketTest, ATicketIsOfNoUseElsewhere) {
  const std::string ticket = ticket_of(new_link());
  const std::string bearer = "Authorization: Bearer " + ticket + "\r\n";
  EXPECT_TRUE(open("/live", bearer)->answer.starts_with("HTTP/1.1 401 "));
  EXPECT_TRUE(open("/live?ticket=" + ticket, "")->answer.starts_with("HTTP/1.1 401 "));
  EXPECT_TRUE(open("/live", "Cookie: rheonaut_session_fedcba9876543210=" + ticket + "\r\n")
                  ->answer.starts_with("HTTP/1.1 401 "));
  EXPECT_TRUE(open("/api/v1/robots", bearer)->answer.starts_with("HTTP/1.1 401 "));
  EXPECT_EQ(ask("POST", "/api/v1/login", {{"code", ticket}}).status, 401);
  EXPECT_TRUE(open("/foxglove?ticket=" + ticket)->open()) << "all of that has not used it up";
}

TEST_F(FoxgloveSocketTest, ALivePageOfAnotherOriginIsStillRefused) {
  EXPECT_TRUE(open("/live", "Authorization: Bearer " + token() + "\r\nOrigin: https://app.foxglove.dev\r\n")
                  ->answer.starts_with("HTTP/1.1 403 "));
}

TEST_F(FoxgloveSocketTest, ATicketRunsOut) {
  const std::string link = new_link(), second = new_link();
  clock.run_for(identity::kTicketValidity - 1s);
  EXPECT_TRUE(open(link)->open());
  clock.run_for(2s);
  EXPECT_TRUE(open(second)->answer.starts_with("HTTP/1.1 401 "));
}

TEST_F(FoxgloveSocketTest, AWrongRequestDoesNotUseTheTicketUp) {
  const std::string link = new_link();
  EXPECT_TRUE(open(link, "")->answer.starts_with("HTTP/1.1 400 ")) << "no sub-protocol";
  EXPECT_TRUE(open(link, "Sec-WebSocket-Protocol: foxglove.websocket.v2\r\n")->answer.starts_with("HTTP/1.1 400 "));
  EXPECT_TRUE(open(link + "&robot=nobody")->answer.starts_with("HTTP/1.1 404 "));
  RawClient preview{clock, port()};
  preview.send("GET " + link + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(preview.read_to_end().starts_with("HTTP/1.1 426 ")) << "it is no WebSocket";
  RawClient rebinding{clock, port()};
  rebinding.send("GET " + link + " HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(rebinding.read_to_end().starts_with("HTTP/1.1 421 "));
  EXPECT_TRUE(open(link)->open());
}

TEST_F(FoxgloveSocketTest, WithoutATicketNoRobotsNameIsTold) {
  connect_robot();
  for (const char* robot : {"r1", "nobody"}) {
    for (const char* ticket : {"", "&ticket=wrong"}) {
      const auto page = open(std::string{"/foxglove?robot="} + robot + ticket);
      EXPECT_TRUE(page->answer.starts_with("HTTP/1.1 401 ")) << page->answer;
    }
  }
}

TEST_F(FoxgloveSocketTest, AClientEndsWithTheCredentialOfWhoMadeItsTicket) {
  const std::string secret = ask("POST", "/api/v1/tokens", {{"name", "eye"}, {"scopes", "read"}}).parsed()["secret"];
  const auto link_of = [&] {
    RawClient asking{clock, port()};
    asking.send(
        "POST /api/v1/foxglove-links HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: 0\r\n"
        "Authorization: Bearer " +
        secret + "\r\n\r\n");
    const std::string answer = asking.read_to_end();
    const auto begin = answer.find("/foxglove?");
    EXPECT_NE(begin, std::string::npos) << answer;
    return answer.substr(begin, answer.find('"', begin) - begin);
  };
  const auto page = open(link_of());
  ASSERT_TRUE(page->open()) << page->answer;
  const std::string unused = link_of();
  ASSERT_EQ(ask("POST", "/api/v1/tokens/eye/revoke").status, 200);
  clock.run_for(1s);
  receive(*page, "nothing of this op");
  EXPECT_TRUE(page->closed());
  EXPECT_TRUE(open(unused)->answer.starts_with("HTTP/1.1 401 "));
}

TEST_F(FoxgloveSocketTest, WhoMayNotReadMakesNoLink) {
  scopes = identity::Scopes{}.add(identity::Scope::stop);
  EXPECT_EQ(ask("POST", "/api/v1/foxglove-links").status, 403);
  scopes = identity::Scopes{}.add(identity::Scope::read);
  EXPECT_EQ(ask("POST", "/api/v1/foxglove-links").status, 201);
  EXPECT_EQ(ask("POST", "/api/v1/foxglove-links", {{"robot_id", "nobody"}}).parsed()["reason"], "unknown_robot");
  EXPECT_EQ(ask("POST", "/api/v1/foxglove-links", {{"robot_id", "a&b"}}).status, 422);
  EXPECT_EQ(ask("POST", "/api/v1/foxglove-links", {{"robot", "r1"}}).status, 400);
}

TEST_F(FoxgloveSocketTest, AClientChangesNothingWhateverItSends) {
  connect_robot();
  const std::size_t before = robot->commands().size();
  const auto page = open(new_link());
  ASSERT_TRUE(page->open());
  for (const char* text : {R"({"op":"advertise","channels":[]})", R"({"type":"emergency_stop","robot_id":"r1"})",
                           R"({"op":"setParameters","parameters":[]})", "nonsense"}) {
    page->say_text(text);
    EXPECT_EQ(receive(*page, "status")["level"], 2) << text;
  }
  page->say_bytes(std::string{"\x01\0\0\0\x01{}", 7});
  EXPECT_EQ(receive(*page, "status")["message"], "publishing is not possible: this connection only reads");
  clock.run_for(1s);
  EXPECT_EQ(robot->commands().size(), before);
  page->say_text(std::string(70'000, ' '));
  receive(*page, "nothing of this op");
  EXPECT_TRUE(page->closed()) << "a message is too long";
}

TEST_F(FoxgloveSocketTest, AStopGoesThroughBesideAClientThatDoesNotRead) {
  connect_robot();
  const auto page = open(new_link({{"robot_id", "r1"}}));
  ASSERT_TRUE(page->open());
  page->say_text(R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":1}]})");
  clock.settle();
  page->client().reads = false;
  for (std::uint64_t seq = 0; seq < 30'000; seq += 25) make_samples(*robot, seq, 25);
  const auto stop = begin("POST", "/api/v1/robots/r1/emergency-stop");
  clock.settle();
  const auto commands = robot->commands();
  EXPECT_TRUE(std::ranges::any_of(commands, [](const protocol::Command& command) {
    return command.which_action == rheonaut_Command_emergency_stop_tag;
  }));
  page->client().reads = true;
  const std::string notice = receive(*page, "status")["message"];
  EXPECT_NE(notice.find("this client reads too slowly"), std::string::npos) << notice;
}

TEST_F(FoxgloveSocketTest, ASilentClientIsPingedAndThenLetGo) {
  const auto page = open(new_link());
  ASSERT_TRUE(page->open());
  page->answers_pings = false;
  clock.run_for(29s);
  receive(*page, "advertise");
  EXPECT_FALSE(page->closed());
  clock.run_for(2s);
  receive(*page, "nothing of this op");
  EXPECT_GE(page->pings, 1);
  EXPECT_TRUE(page->closed());
}

TEST(FoxgloveOff, IsAProblemThatSaysHowToTurnItOn) {
  class Off : public ApiTest {
   public:
    void check() {
      const Answered link = ask("POST", "/api/v1/foxglove-links");
      EXPECT_EQ(link.status, 404);
      EXPECT_EQ(link.parsed()["reason"], "foxglove_off");
      EXPECT_NE(link.body.find("[foxglove]"), std::string::npos);
      EXPECT_EQ(ask("GET", "/foxglove").parsed()["reason"], "foxglove_off");
      const Page page{clock, port(), kProtocol, "127.0.0.1", [] {}, "/foxglove?ticket=x"};
      EXPECT_TRUE(page.answer.starts_with("HTTP/1.1 404 ")) << page.answer;
    }

   private:
    void TestBody() override {}
  };
  Off{}.check();
}

TEST(Tickets, EachActorHasAFewAndTheyReadAlone) {
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  identity::Tickets tickets{clock};
  identity::Caller maker{"token:a", "", identity::Scopes::of(identity::Role::admin), 0, nullptr, ""};
  const std::string first = tickets.issue(maker);
  for (std::size_t i = 0; i < identity::kMaxTicketsOfOne; ++i) tickets.issue(maker);
  EXPECT_EQ(tickets.size(), identity::kMaxTicketsOfOne);
  EXPECT_FALSE(tickets.redeem(first)) << "newer ones have taken its place";
  for (int i = 0; i < 1000; ++i) {
    maker.actor = "token:" + std::to_string(i);
    tickets.issue(maker);
  }
  EXPECT_EQ(tickets.size(), identity::kMaxTickets);
  const std::string ticket = tickets.issue(maker);
  const auto caller = tickets.redeem(ticket);
  ASSERT_TRUE(caller);
  EXPECT_EQ(text(caller->scopes), "read");
  EXPECT_FALSE(tickets.redeem(ticket));
}

}  // namespace
}  // namespace server
