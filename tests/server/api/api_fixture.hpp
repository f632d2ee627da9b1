// A whole station with its API in virtual time, one hand-made robot, and clients that talk over real loopback sockets.
//
// The station's parts stand in api_fixture.cpp. A test that does more with a part than ApiTest offers includes the
// part's own header.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "server/http/http.hpp"
#include "server/storage/recording_parts.hpp"
#include "tests/server/link/test_robot.hpp"

namespace server::http {
class Router;
}  // namespace server::http

namespace server::identity {
class Accounts;
class Logins;
}  // namespace server::identity

namespace server::live {
class LiveFeed;
}  // namespace server::live

namespace server::net {
class TransportSecurity;
}  // namespace server::net

namespace server {

using namespace std::chrono_literals;
using nlohmann::json;

// A hash that takes no time; what it costs is no matter of these tests.
inline constexpr runtime::PasswordCost kCheapPasswords{1, 8192};

class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

// An answer with its stream, if it has one, read to the end.
struct Answered {
  std::string method, pattern;  // of the route; empty: of none
  int status = 0;
  std::string body;
  http::Response response;
  json parsed() const { return json::parse(body); }
};

// Is given each answer of a route before the test is. In server_api_test it fails the test for an answer that
// server/api/openapi.yaml does not describe (openapi_answers.cpp); elsewhere there is none.
inline void (*check_answer)(const Answered&) = nullptr;

class ApiTest : public ::testing::Test {
 public:
  // The database is in `folder`: a new one, or a copy of the one that `of_recorder` names.
  explicit ApiTest(config::Config of_station = {}, storage::RecorderOptions of_recorder = {});
  ~ApiTest() override;

 protected:
  TestRobot& connect_robot();  // "r1", boot 77, in manual

  // Asks the routes directly, past socket and guard.
  Answered ask(const std::string& method, const std::string& target, const json& body = nullptr);
  // The same in two steps, for what the robot must answer in between.
  std::shared_ptr<std::optional<Answered>> begin(const std::string& method, const std::string& target,
                                                 const json& body = nullptr,
                                                 std::map<std::string, std::string> headers = {});
  Answered end(const std::shared_ptr<std::optional<Answered>>& asked, microseconds limit = 10s);

  SQLite::Database lock_disk() const {  // nobody else writes until it goes
    SQLite::Database other{recorder.path().string(), SQLite::OPEN_READWRITE};
    other.exec("BEGIN IMMEDIATE");
    return other;
  }

  void make_samples(TestRobot& robot, std::uint64_t first_seq, pb_size_t count);
  std::string token() const;

  // The server of the API.
  std::uint16_t port() const;
  std::string login_url();
  std::optional<std::int64_t> seen_us(std::int64_t experiment) const;  // by the client in whose hands it is
  const http::Router& router() const;
  identity::Accounts& accounts();
  const identity::Logins& logins() const;

  identity::Scopes scopes = identity::Scopes::of(identity::Role::admin);  // of who asks
  std::string actor = "token:local";                                      // likewise
  std::uint64_t session = 0;                                              // likewise: of a page
  std::string client;                                                     // likewise: its id
  config::Config config;                                                  // of the ports
  TemporaryFolder folder;
  boost::asio::io_context loop{1};
  std::shared_ptr<identity::Standing> standing = std::make_shared<identity::Standing>(loop);  // of who asks
  runtime::WorkerThread disk{"disk"}, readers{"readers"}, exports{"exports"}, checkpoints{"checkpoints"},
      maths{"maths"};
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  station::Station station{loop, clock, config.envelope, config::LinkTimes{}};
  storage::RecordingParts recording;
  storage::Recorder& recorder{recording.recorder};

 private:
  struct Parts;  // all others
  std::unique_ptr<Parts> parts_;

 protected:
  live::LiveFeed& live;
  net::TransportSecurity& security;
  link::RobotListener& robots;
  std::unique_ptr<TestRobot> robot;

 private:
  boost::asio::awaitable<void> answer(http::Request request, std::shared_ptr<std::optional<Answered>> into);
};

// A client that sends raw bytes and lets the station run while it waits.
class RawClient {
 public:
  // `from` is an address of this machine.
  RawClient(VirtualClock& clock, std::uint16_t port, const char* from = "127.0.0.1");
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  bool send(std::string_view bytes);                // false when the station closed before it took them all
  std::string read_until(const std::string& mark);  // everything up to and with the mark, or what came before the end
  std::string read_to_end();                        // until the station closes
  std::string read_exactly(std::size_t count);      // or less at the end
  bool closed();                                    // the station has closed, and everything was read

  bool reads = true;     // false: it takes nothing any more
  bool is_held = false;  // true: what is sent waits in the socket, since the station does not run

 private:
  bool pump();  // lets the station run, takes what arrived; false after the end

  VirtualClock& clock_;
  int socket_ = -1;
  std::string received_;
  bool ended_ = false;
};

}  // namespace server
