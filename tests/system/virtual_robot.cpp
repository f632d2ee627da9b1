// Ticks, reads and writes of the robot in virtual time.
#include "tests/system/virtual_robot.hpp"

#include <array>

#include "tests/server/stream_reader.hpp"

namespace server {
namespace asio = boost::asio;

struct VirtualRobot::Link {
  static constexpr std::size_t kSendBufferBytes = 4096;  // what the robot's TCP stack takes without waiting

  explicit Link(asio::io_context& loop) : memory{loop}, written{loop} {}

  net::MemoryLink memory;
  std::unique_ptr<net::ByteStream> stream = memory.take_first();
  std::vector<std::uint8_t> waiting;
  runtime::Signal written;
  bool ended = false;
};

VirtualRobot::VirtualRobot(asio::io_context& loop, runtime::Clock& clock, runtime::TaskGroup& tasks,
                           sim_robot::SimulatedRobotConfig config)
    : loop_{loop}, clock_{clock}, tasks_{tasks}, robot_{std::move(config)}, booted_at_us_{clock.steady_us()} {
  tasks_.spawn("virtual robot", tick());
}

void VirtualRobot::dial(link::RobotListener& listener) {
  listener_ = &listener;
  const auto link = link_ = std::make_shared<Link>(loop_);
  listener.serve(link->memory.take_second());
  robot_.link_opened(now_us());
  tasks_.spawn("virtual robot reads", read(link));
  tasks_.spawn("virtual robot writes", write(link));
  pump();
}

void VirtualRobot::cut() {
  if (link_) link_->memory.cut();
}

void VirtualRobot::stall(bool stalled) {
  if (link_) link_->memory.stall(stalled);
}

asio::awaitable<void> VirtualRobot::tick() {
  for (std::uint64_t seq = 0;; ++seq) {
    co_await clock_.sleep_until(tick_at_us(seq));
    robot_.step();
    if (on_tick) on_tick();
    if (link_ && robot_.core().connection_is_silent(now_us())) lose(link_);
    pump();
  }
}

void VirtualRobot::pump() {
  if (!link_) return;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
  while (link_->waiting.size() < Link::kSendBufferBytes) {
    const std::size_t size = robot_.transmit(bytes.data(), bytes.size(), now_us());
    if (size == 0) break;
    link_->waiting.insert(link_->waiting.end(), bytes.data(), bytes.data() + size);
  }
  if (!link_->waiting.empty()) link_->written.notify();
}

asio::awaitable<void> VirtualRobot::read(std::shared_ptr<Link> link) {
  std::array<std::uint8_t, 2048> bytes;
  for (;;) {
    const std::size_t size = co_await read_some(loop_, *link->stream, asio::buffer(bytes));
    const bool goes_on = size > 0 && !link->ended && robot_.receive({bytes.data(), size}, now_us());
    if (!goes_on) break;
    pump();
  }
  lose(link);
}

asio::awaitable<void> VirtualRobot::write(std::shared_ptr<Link> link) {
  while (!link->ended) {
    co_await link->written.wait();
    const auto bytes = std::exchange(link->waiting, {});
    const bool written = bytes.empty() || co_await link->stream->write(asio::buffer(bytes));
    if (!written) break;
  }
}

void VirtualRobot::lose(const std::shared_ptr<Link>& link) {
  if (link->ended) return;
  link->ended = true;
  link->memory.cut();
  if (link_ != link) return;
  link_.reset();
  robot_.link_closed(now_us());
  if (redial) tasks_.spawn("virtual robot dials", dial_later());
}

asio::awaitable<void> VirtualRobot::dial_later() {
  constexpr std::chrono::milliseconds kPause{500};
  co_await clock_.sleep_for(kPause);
  if (!link_) dial(*listener_);
}

}  // namespace server
