// Tools whose station is silent, or falls silent in the middle of its answer: each wait ends, and says what to do.
#include <gmock/gmock.h>
#include <unistd.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <thread>

#include "server/cli/accounts/station_client.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

// Connections are taken by the kernel; of one it answers these bytes, and keeps it open.
class SilentStation {
 public:
  explicit SilentStation(const std::filesystem::path& data_dir, std::vector<std::string> pieces = {},
                         std::chrono::milliseconds pause = 0ms)
      : pieces_{std::move(pieces)}, pause_{pause} {
    std::filesystem::create_directories(data_dir);
    std::ofstream{data_dir / "rheonaut.token"} << "secret\n";
    std::ofstream{data_dir / "endpoints.json"} << nlohmann::json{{"http", address()}};
    if (!pieces_.empty()) thread_ = std::thread{[this] { serve(); }};
  }
  ~SilentStation() {
    if (thread_.joinable()) thread_.join();
  }
  SilentStation(const SilentStation&) = delete;
  SilentStation& operator=(const SilentStation&) = delete;

  // The head of the request, when it has been answered.
  const std::string& request() {
    thread_.join();
    return request_;
  }
  std::string address() const { return "127.0.0.1:" + std::to_string(acceptor_.local_endpoint().port()); }

 private:
  void serve() {
    socket_ = acceptor_.accept();
    asio::read_until(socket_, asio::dynamic_buffer(request_), "\r\n\r\n");
    for (const std::string& piece : pieces_) {
      boost::system::error_code gone;  // the tool may have left
      asio::write(socket_, asio::buffer(piece), gone);
      std::this_thread::sleep_for(pause_);
    }
  }

  std::vector<std::string> pieces_;
  std::chrono::milliseconds pause_;
  asio::io_context loop_;
  tcp::acceptor acceptor_{loop_, {asio::ip::address_v4::loopback(), 0}};
  tcp::socket socket_{loop_};
  std::string request_;
  std::thread thread_;
};

std::string head(const char* type, std::size_t size) {
  return std::string{"HTTP/1.1 200 OK\r\nContent-Type: "} + type + "\r\nContent-Length: " + std::to_string(size) +
         "\r\n\r\n";
}

template <class Act>
std::string error_of(const Act& act) {
  try {
    act();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

using SilentStationTest = ToolTest;

// The tool ends before it asks anybody.
TEST_F(SilentStationTest, AFileThatOthersMayHaveWrittenIsNotTrusted) {
  const SilentStation station{folder_ / "lab"};
  for (const char* name : {"rheonaut.token", "endpoints.json"}) {
    const std::filesystem::path file = folder_ / "lab" / name;
    std::filesystem::permissions(file, std::filesystem::perms{0602});
    EXPECT_THAT(ask("job list --data @lab").error, HasSubstr("all users may write to the file")) << name;
    std::filesystem::permissions(file, std::filesystem::perms{0600});
    std::filesystem::rename(file, folder_ / "elsewhere");
    std::filesystem::create_symlink(folder_ / "elsewhere", file);
    EXPECT_THAT(ask("job list --data @lab").error, HasSubstr("is a link")) << name;
    std::filesystem::rename(folder_ / "elsewhere", file);
  }
}

TEST_F(SilentStationTest, AFileOfAnotherUserIsNotTrusted) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  const SilentStation station{folder_ / "lab"};
  for (const char* name : {"endpoints.json", "rheonaut.token"}) {
    ASSERT_EQ(::chown((folder_ / "lab" / name).c_str(), 4711, 0), 0);
    EXPECT_THAT(ask("job list --data @lab").error, HasSubstr("belongs to 4711")) << name;
  }
}

TEST_F(SilentStationTest, AQuestionWithoutAnAnswerEndsAndSaysWhichStationHowLongAndWhatToDo) {
  const SilentStation station{folder_ / "data"};
  const StationClient client{folder_ / "data"};
  const std::string error = error_of([&] { client.ask("GET", "/api/v1/robots", nullptr, {200ms}); });
  EXPECT_THAT(error, HasSubstr("the station on " + station.address() + " has not answered within 0.2 s;"));
  EXPECT_THAT(error, HasSubstr("rheonaut doctor --data '" + (folder_ / "data").string() + "' examines it"));
  EXPECT_THAT(error, ::testing::Not(HasSubstr("--timeout-s")));
  EXPECT_THAT(error, ::testing::Not(HasSubstr("repeat")));
}

TEST_F(SilentStationTest, WhatMayHaveBeenDoneIsNotCalledUndone) {
  const SilentStation station{folder_ / "data"};
  const StationClient client{folder_ / "data"};
  const std::string error = error_of([&] { client.ask("POST", "/api/v1/backups", {{"name", "b"}}, {200ms}); });
  EXPECT_THAT(error, HasSubstr("look before you repeat it"));
}

TEST_F(SilentStationTest, AnAnswerThatStallsEnds) {
  const SilentStation station{folder_ / "data", {head("application/json", 100) + "{\"robots\":"}};
  const StationClient client{folder_ / "data"};
  const std::string error = error_of([&] { client.ask("GET", "/api/v1/robots", nullptr, {300ms}); });
  EXPECT_THAT(error, HasSubstr("has not answered within 0.3 s"));
}

// The limit is of each wait: a file may take longer as a whole.
TEST_F(SilentStationTest, AFileThatStallsEndsAndLeavesTheOneBefore) {
  save("run-1.html", "before");
  const std::string page(50, 'x');
  const SilentStation station{folder_ / "data", {head("text/html", 100), page}};
  const Answer answer = ask("report 1 --to @run-1.html --timeout-s 0.5 --data @data");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, HasSubstr("the station on " + station.address() + " has sent nothing for 0.5 s;"));
  EXPECT_THAT(answer.error, HasSubstr("--timeout-s waits longer"));
  std::ifstream kept{folder_ / "run-1.html"};
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>{kept}, {}), "before");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "run-1.html.part"));
}

TEST_F(SilentStationTest, AFileThatNeverBeginsEnds) {
  const SilentStation station{folder_ / "data"};
  const Answer answer = ask("capsule 1 --to @run-1.eln --timeout-s 0.2 --data @data");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, HasSubstr("has sent nothing for 0.2 s"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "run-1.eln"));
}

// Slower as a whole than the limit, and never silent for so long, unless the machine stalls: then the file is fetched
// again. A limit of the whole would end every attempt.
TEST_F(SilentStationTest, AFileThatComesSlowlyIsWhole) {
  std::vector<std::string> pieces{head("text/html", 60)};
  for (int i = 0; i < 6; ++i) pieces.emplace_back(10, 'x');
  Answer answer;
  answer.exit_code = 1;
  const auto give_up_at = std::chrono::steady_clock::now() + 2min;
  while (answer.exit_code != 0 && std::chrono::steady_clock::now() < give_up_at) {
    const SilentStation station{folder_ / "data", pieces, 200ms};
    answer = ask("report 1 --to @run-1.html --timeout-s 1 --json --data @data");
  }
  EXPECT_EQ(answer.exit_code, 0) << answer.error;
  EXPECT_EQ(std::filesystem::file_size(folder_ / "run-1.html"), 60u);
  const nlohmann::json said{{"runs", {1}}, {"file", (folder_ / "run-1.html").string()}, {"size_bytes", 60}};
  EXPECT_EQ(answer.json(), said);
}

// The station makes login links of it.
TEST_F(SilentStationTest, TheHostOfARequestIsTheAddressWithItsPort) {
  SilentStation station{folder_ / "data", {head("application/json", 2) + "{}"}};
  EXPECT_EQ(StationClient{folder_ / "data"}.ask("GET", "/api/v1/me").status, 200);
  EXPECT_THAT(station.request(), HasSubstr("\r\nHost: " + station.address() + "\r\n"));
}

TEST_F(SilentStationTest, AnArchiveIsNamedInJson) {
  const SilentStation station{folder_ / "data", {head("application/zip", 4) + "abcd"}};
  const Answer answer = ask("capsule 7 --to @run-7.eln --json --data @data");
  ASSERT_EQ(answer.exit_code, 0) << answer.error;
  const nlohmann::json said{{"run_id", 7}, {"file", (folder_ / "run-7.eln").string()}, {"size_bytes", 4}};
  EXPECT_EQ(answer.json(), said);
}

}  // namespace
}  // namespace server::cli
