// A question whose client has gone is not worked at any further; what changes something is carried out all the same.
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <future>
#include <thread>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

// A client that never waits for the station.
class QuietClient {
 public:
  explicit QuietClient(std::uint16_t port) : socket_{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)} {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ::fcntl(socket_, F_SETFL, O_NONBLOCK);
  }
  ~QuietClient() { leave(); }
  QuietClient(const QuietClient&) = delete;
  QuietClient& operator=(const QuietClient&) = delete;

  void send(const std::string& text) const {
    EXPECT_EQ(::send(socket_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  std::string received() const {
    std::string text(65536, '\0');
    const ssize_t size = ::recv(socket_, text.data(), text.size(), 0);
    return text.substr(0, size > 0 ? static_cast<std::size_t>(size) : 0);
  }
  void leave() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }

 private:
  int socket_;
};

boost::asio::awaitable<void> hold(WorkerThread& worker, std::shared_future<void> until) {
  auto job = [until] { until.wait(); };
  co_await worker.run(std::move(job));
}

class CancelTest : public ApiTest {
 protected:
  // The worker does nothing more until go_on().
  void stop_working(WorkerThread& worker) {
    gate_ = std::promise<void>{};
    tasks.spawn("gate", hold(worker, gate_.get_future().share()));
    loop.poll();
  }
  void go_on() {
    gate_.set_value();
    clock.settle();
  }
  std::string head(const std::string& request) const {
    return request + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\nAuthorization: Bearer " + token() +
           "\r\n\r\n";
  }
  template <class Condition>
  void poll_until(Condition condition) {
    const auto patience = std::chrono::steady_clock::now() + 10s;
    while (!condition() && std::chrono::steady_clock::now() < patience) {
      loop.poll_one();
      std::this_thread::yield();
    }
    ASSERT_TRUE(condition());
  }
  std::uint64_t questions() { return recording.history.reader().questions(); }

  void make_run() {
    connect_robot();
    ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "run"}});
    make_samples(*robot, 0, 25);
  }

  // How many questions the readers answer when the client asks this, and goes or stays while they are busy.
  std::uint64_t questions_for(const std::string& target, bool stays) {
    QuietClient client{api->port()};
    const std::uint64_t before = questions();
    stop_working(readers);
    client.send(head("GET " + target));
    poll_until([&] { return questions() == before + 1; });
    if (!stays) client.leave();
    loop.poll();
    go_on();
    if (stays) EXPECT_TRUE(client.received().starts_with("HTTP/1.1 200 "));
    return questions() - before;
  }

 private:
  std::promise<void> gate_;
};

TEST_F(CancelTest, AQuestionWhoseClientHasGoneAsksNoFurther) {
  make_run();
  for (const char* target : {"/api/v1/runs/1/overview", "/api/v1/runs/1/samples", "/api/v1/robots/r1/gaps"}) {
    SCOPED_TRACE(target);
    EXPECT_GT(questions_for(target, true), 1u);
    EXPECT_EQ(questions_for(target, false), 1u);
  }
}

// The rest of an export is not read for nobody.
TEST_F(CancelTest, AnExportWhoseClientHasGoneEnds) {
  make_run();
  for (std::uint64_t seq = 25; seq < 10'000; seq += 25) make_samples(*robot, seq, 25);
  const auto& exports_reader = recording.exports.reader();
  std::uint64_t of_whole = exports_reader.questions();
  ask("GET", "/api/v1/runs/1/samples.csv");
  of_whole = exports_reader.questions() - of_whole;
  ASSERT_GT(of_whole, 5u);
  QuietClient client{api->port()};
  const std::uint64_t before = exports_reader.questions();
  client.send(head("GET /api/v1/runs/1/samples.csv"));
  poll_until([&] { return exports_reader.questions() >= before + 2; });  // it has begun
  client.leave();
  clock.settle();
  EXPECT_LT(exports_reader.questions() - before, of_whole);
}

TEST_F(CancelTest, AFileThatNobodyWaitsForIsRemoved) {
  make_run();
  for (const char* target : {"/api/v1/runs/1/samples.mat", "/api/v1/runs/1/samples.sqlite"}) {
    QuietClient client{api->port()};
    const std::uint64_t before = recording.exports.reader().questions();
    client.send(head(std::string{"GET "} + target));
    poll_until([&] { return recording.exports.reader().questions() >= before + 3; });  // it is being written
    client.leave();
    clock.settle();
    EXPECT_TRUE(std::filesystem::is_empty(recording.exports_folder()));
  }
}

TEST_F(CancelTest, TheNextQuestionIsAnsweredAfterOneThatWasGivenUp) {
  make_run();
  questions_for("/api/v1/runs/1/overview", false);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/overview").parsed()["samples"], json(std::vector<int>(25, 1)));
}

// Requests sent ahead are no sign of leaving.
TEST_F(CancelTest, AClientThatSendsAheadIsAnsweredInOrder) {
  make_run();
  QuietClient client{api->port()};
  client.send(head("GET /api/v1/runs/1/gaps") + head("GET /api/v1/robots/r9/gaps"));
  std::string answers;
  poll_until([&] {
    clock.settle();
    answers += client.received();
    return answers.find("there is no robot r9") != std::string::npos;
  });
  EXPECT_LT(answers.find("HTTP/1.1 200"), answers.find("HTTP/1.1 404"));
}

// SAFETY: a stop, and whatever else changes something.
TEST_F(CancelTest, APostIsCarriedOutThoughItsClientHasGone) {
  make_run();
  QuietClient client{api->port()};
  stop_working(disk);
  RobotEvent event;  // that the run's end must wait for
  event.robot_id = "r1";
  event.kind = "limit";
  recorder.on_event(*station.find("r1"), event);
  client.send(head("POST /api/v1/runs/1/end"));
  loop.poll();
  loop.poll();
  client.leave();
  loop.poll();
  go_on();
  clock.run_for(4s);
  EXPECT_NE(ask("GET", "/api/v1/runs/1").parsed()["ended_at_us"], nullptr);
}

}  // namespace
}  // namespace server
