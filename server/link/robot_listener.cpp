// Starts a session for each robot that dials in.
#include "server/link/robot_listener.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/error.hpp>
#include <boost/system/system_error.hpp>
#include <optional>

namespace server {
namespace asio = boost::asio;

namespace {

// One more while it lives.
class Counted {
 public:
  explicit Counted(int& count) : count_{count} { ++count_; }
  ~Counted() { --count_; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

 private:
  int& count_;
};

}  // namespace

RobotListener::RobotListener(asio::io_context& loop, Clock& clock, TaskGroup& tasks, Station& station,
                             RobotArchive& archive, const asio::ip::tcp::endpoint& endpoint, bool or_any_port)
    : loop_{loop},
      clock_{clock},
      tasks_{tasks},
      station_{station},
      archive_{archive},
      listener_{loop, clock, endpoint, or_any_port} {}

asio::awaitable<void> RobotListener::run() {
  auto on_connection = [this](asio::ip::tcp::socket socket) { serve(make_tcp_stream(std::move(socket))); };
  co_await listener_.run(on_connection);
}

void RobotListener::serve(std::unique_ptr<ByteStream> stream) {
  if (connections_ >= kMaxConnections || greetings_ >= kMaxGreetings) {
    spdlog::warn("robot port: {} closed: {} connections are open, {} of them without a hello", stream->peer(),
                 connections_, greetings_);
    return;
  }
  tasks_.spawn("robot session", session(std::move(stream)));
}

asio::awaitable<void> RobotListener::session(std::unique_ptr<ByteStream> stream) {
  const std::string peer = stream->peer();
  const Counted connection{connections_};
  std::optional<Counted> greeting{greetings_};
  RobotSession session{loop_, clock_, std::move(stream), station_, archive_};
  try {
    const bool welcome = co_await session.greet();
    greeting.reset();
    if (welcome) co_await session.serve();
  } catch (const boost::system::system_error& error) {
    if (error.code() != asio::error::operation_aborted) spdlog::warn("robot session {}: {}", peer, error.what());
  } catch (const std::exception& error) {
    spdlog::error("robot session {}: {}", peer, error.what());
  }
}

}  // namespace server
