// A question whose client has gone is not worked at any further; what changes something is carried out all the same.
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
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
  // Returns when the station's end of the connection knows it: on a busy machine that takes a moment.
  void leave() {
    if (socket_ < 0) return;
    ::shutdown(socket_, SHUT_WR);
    const auto patience = std::chrono::steady_clock::now() + std::chrono::minutes{2};
    while (is_end_unacknowledged() && std::chrono::steady_clock::now() < patience) std::this_thread::yield();
    ::close(socket_);
    socket_ = -1;
  }

 private:
  bool is_end_unacknowledged() const {
    tcp_info info{};
    socklen_t size = sizeof info;
    return ::getsockopt(socket_, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 && info.tcpi_state == TCP_FIN_WAIT1;
  }

  int socket_;
};

boost::asio::awaitable<void> hold(runtime::WorkerThread& worker, std::shared_future<void> until,
                                  std::shared_ptr<std::atomic<bool>> begun = std::make_shared<std::atomic<bool>>()) {
  auto job = [until, begun] {
    *begun = true;
    until.wait();
  };
  co_await worker.run(std::move(job));
}

class CancelTest : public ApiTest {
 protected:
  // The worker does nothing more until go_on(), and the loop knows what it did before.
  void stop_working(runtime::WorkerThread& worker) {
    gate_ = std::promise<void>{};
    auto begun = std::make_shared<std::atomic<bool>>();
    tasks.spawn("gate", hold(worker, gate_.get_future().share(), begun));
    poll_until([&] { return begun->load(); });
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
    const auto patience = std::chrono::steady_clock::now() + 2min;
    while (!condition() && std::chrono::steady_clock::now() < patience) {
      loop.poll_one();
      std::this_thread::yield();
    }
    ASSERT_TRUE(condition());
  }
  std::uint64_t questions() { return recording.history.reader().questions(); }
  std::uint64_t export_questions() { return recording.exports.reader().questions(); }
  int export_files(std::uintmax_t least_bytes = 0) {
    std::error_code none;
    int files = 0;
    for (const auto& file : std::filesystem::directory_iterator{recording.exports_folder(), none}) {
      const std::uintmax_t bytes = file.file_size(none);
      if (!none && bytes >= least_bytes) ++files;
    }
    return files;
  }

  void make_run() {
    connect_robot();
    ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "run"}});
    make_samples(*robot, 0, 25);
  }

  // How many questions the readers answer when the client asks this, and goes or stays while they are busy.
  std::uint64_t questions_for(const std::string& target, bool stays) {
    QuietClient client{port()};
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

// The rest of an export is not read for nobody, and what was written of its file is removed. The client leaves when the
// export has begun and its next question waits for the worker; with nothing unread, so that no write of the station
// fails before one that would succeed.
TEST_F(CancelTest, AnExportWhoseClientHasGoneAsksNoFurther) {
  make_run();
  for (std::uint64_t seq = 25; seq < 10'000; seq += 25) make_samples(*robot, seq, 25);
  std::uint64_t of_whole = export_questions();
  ask("GET", "/api/v1/runs/1/samples.csv");
  of_whole = export_questions() - of_whole;
  ASSERT_GT(of_whole, 5u);
  for (const char* ending : {".csv", ".mat", ".sqlite"}) {
    const bool is_file = ending != std::string{".csv"};
    for (const bool is_written : {false, true}) {  // at its first question, or when some of it is made
      SCOPED_TRACE(std::string{ending} + (is_written ? ", written" : ", begun"));
      QuietClient client{port()};
      const std::uint64_t before = export_questions();
      client.send(head(std::string{"GET /api/v1/runs/1/samples"} + ending));
      poll_until([&] {
        if (is_written && is_file) return export_files(1) > 0;  // by a program: it is asked for as long as that takes
        return export_questions() >= before + (is_written ? of_whole / 2 : 1);
      });
      stop_working(exports);
      poll_until([&] {
        client.received();
        return exports.jobs() == 2;  // the gate, and a question behind it
      });
      while (!client.received().empty()) continue;
      const std::uint64_t asked = export_questions();
      if (!is_file) ASSERT_LT(asked - before, of_whole);
      client.leave();
      loop.poll();
      go_on();
      EXPECT_EQ(export_questions(), asked);
      if (is_file) {  // the worker removes the file when it comes to it
        poll_until([&] { return export_files() == 0; });
      }
    }
  }
}

// SAFETY: a stop is answered while the readers and an export are busy, and whoever is cancelled meanwhile does not
// take it along.
TEST_F(CancelTest, AStopIsAnsweredBesideQuestionsThatAreCancelled) {
  make_run();
  const std::uint64_t asked_before = questions();
  const std::uint64_t exported_before = export_questions();
  QuietClient question{port()};
  QuietClient file{port()};
  QuietClient stop{port()};
  std::promise<void> gate;
  const std::shared_future<void> opened = gate.get_future().share();
  for (runtime::WorkerThread* worker : {&readers, &exports}) tasks.spawn("gate", hold(*worker, opened));
  question.send(head("GET /api/v1/runs/1/overview"));
  file.send(head("GET /api/v1/runs/1/samples.mat"));
  poll_until([&] { return questions() == asked_before + 1 && export_questions() == exported_before + 1; });
  stop.send(head("POST /api/v1/robots/r1/emergency-stop"));
  const auto stops = [this] {
    auto sent = robot->commands();
    std::erase_if(sent, [](const auto& one) { return one.which_action != rheonaut_Command_emergency_stop_tag; });
    return sent;
  };
  poll_until([&] { return stops().size() == 1; });
  question.leave();
  file.leave();
  robot->acknowledge(stops().front(), rheonaut_COMMAND_RESULT_ACCEPTED, 7);
  std::string answer;
  poll_until([&] {
    answer += stop.received();
    return answer.find("\r\n\r\n") != std::string::npos;
  });
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
  gate.set_value();
  clock.settle();
  EXPECT_EQ(questions(), asked_before + 1);
  EXPECT_EQ(export_questions(), exported_before + 1);
}

TEST_F(CancelTest, TheNextQuestionIsAnsweredAfterOneThatWasGivenUp) {
  make_run();
  questions_for("/api/v1/runs/1/overview", false);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/overview").parsed()["samples"], json(std::vector<int>(25, 1)));
}

// Requests sent ahead are no sign of leaving.
TEST_F(CancelTest, AClientThatSendsAheadIsAnsweredInOrder) {
  make_run();
  QuietClient client{port()};
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
  QuietClient client{port()};
  stop_working(disk);
  station::RobotEvent event;  // that the run's end must wait for
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
