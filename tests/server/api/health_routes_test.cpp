// What supervisors ask: alive, ready, and why not.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <algorithm>

#include "server/net/transport_security.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;

class HealthRoutesTest : public ApiTest {
 protected:
  explicit HealthRoutesTest(config::Config of_station = {}) : ApiTest{std::move(of_station)} {
    set_free_bytes(kRoom);
    security.robots().listening = 1;  // this station has a robot without a port
  }

  static constexpr std::uint64_t kRoom = 50'000'000'000;

  void set_free_bytes(std::uint64_t bytes) {
    recording.disk_watch.set_free_bytes([bytes](const fs::path&) { return bytes; });
    clock.run_for(6s);
  }
  // Over a socket, as a supervisor asks: without any credential.
  std::string get(const std::string& target) {
    RawClient client{clock, port()};
    client.send("GET " + target + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    return client.read_to_end();
  }
  json readiness() {
    const std::string answer = get("/readyz");
    json body = json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
    EXPECT_TRUE(answer.starts_with(body["ready"] == true ? "HTTP/1.1 200 " : "HTTP/1.1 503 ")) << answer;
    EXPECT_THAT(answer, ::testing::HasSubstr("Cache-Control: no-store\r\n"));
    EXPECT_THAT(answer, ::testing::Not(::testing::HasSubstr(folder.path().string()))) << "tells where the data is";
    EXPECT_THAT(answer, ::testing::Not(::testing::HasSubstr(token())));
    return body;
  }
  std::vector<std::string> reasons() {
    std::vector<std::string> found;
    for (const json& problem : readiness()["problems"]) found.push_back(problem["reason"]);
    return found;
  }
};

using Reasons = std::vector<std::string>;

TEST_F(HealthRoutesTest, AliveAndReadyWithoutAToken) {
  const std::string alive = get("/healthz");
  EXPECT_TRUE(alive.starts_with("HTTP/1.1 200 OK\r\n")) << alive;
  EXPECT_TRUE(alive.ends_with("{\"alive\":true}")) << alive;
  EXPECT_THAT(alive, ::testing::HasSubstr("Cache-Control: no-store\r\n"));
  EXPECT_EQ(readiness(), json::parse(R"({"ready": true, "problems": []})"));
  EXPECT_TRUE(get("/healthz?x=1").ends_with("{\"alive\":true}"));
  EXPECT_TRUE(get("/readyz?x").starts_with("HTTP/1.1 200 "));
}

TEST_F(HealthRoutesTest, NotReadyWhileNothingBecomesDurable) {
  connect_robot();
  SQLite::Database foreign{(folder.path() / "station.sqlite").string(), SQLite::OPEN_READWRITE};
  foreign.exec("BEGIN IMMEDIATE");
  make_samples(*robot, 0, 20);
  clock.run_for(2s);
  EXPECT_EQ(reasons(), Reasons{"recording_failing"});
  EXPECT_TRUE(get("/healthz").starts_with("HTTP/1.1 200 ")) << "alive all the same";
  foreign.exec("ROLLBACK");
  clock.run_for(3s);
  EXPECT_EQ(reasons(), Reasons{});
}

TEST_F(HealthRoutesTest, NotReadyBelowTheCriticalLimitAndReadyWhileItIsMerelyLow) {
  set_free_bytes(1'000'000'000);  // low_space_mb is 2048, critical_space_mb 512
  EXPECT_EQ(reasons(), Reasons{});
  set_free_bytes(100'000'000);
  EXPECT_EQ(reasons(), Reasons{"low_space"});
  set_free_bytes(kRoom);
  EXPECT_EQ(reasons(), Reasons{});
}

TEST_F(HealthRoutesTest, NotReadyWhenTheDatabaseCannotBeWritten) {
  const fs::path database = folder.path() / "station.sqlite";
  fs::rename(database, folder.path() / "elsewhere");  // root may write everything, but not what is not there
  clock.run_for(6s);
  EXPECT_EQ(reasons(), Reasons{"database_read_only"});
  fs::rename(folder.path() / "elsewhere", database);
  clock.run_for(6s);
  EXPECT_EQ(reasons(), Reasons{});
}

TEST_F(HealthRoutesTest, NotReadyWhileAPortDoesNotListen) {
  const auto listening = security.http().listening;
  security.robots().listening = 0;
  EXPECT_EQ(reasons(), Reasons{"not_listening"});
  security.robots().listening = 1;
  security.http().listening = 0;
  EXPECT_EQ(reasons(), Reasons{"not_listening"});
  security.http().listening = listening;
  EXPECT_EQ(reasons(), Reasons{});
}

class FewConnectionsTest : public HealthRoutesTest {
 protected:
  static config::Config with_two_connections() {
    config::Config config;
    config.http_places = {2, 2};
    return config;
  }
  FewConnectionsTest() : HealthRoutesTest{with_two_connections()} {}
};

TEST_F(FewConnectionsTest, AnsweredThoughAllConnectionsAreTakenByIdleOnes) {
  RawClient first{clock, port()}, second{clock, port()};
  const std::string request = "GET /api/v1/me HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token();
  for (RawClient* client : {&first, &second}) {
    client->send(request + "\r\n\r\n");
    client->read_until("}");
  }
  EXPECT_TRUE(get("/healthz").starts_with("HTTP/1.1 200 "));
  EXPECT_EQ(reasons(), Reasons{});
}

}  // namespace
}  // namespace server
