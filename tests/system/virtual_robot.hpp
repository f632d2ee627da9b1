// A simulated robot that dials the station in the same process, in virtual time: the real core, link and plant.
//
//   VirtualRobot robot{loop, clock, tasks, {}};
//   robot.dial(listener);                 // and again by itself when redial is set
//   clock.run_until([&] { … }, 2s);       // it ticks every 10 ms of virtual time
//
// Loop thread. Outlives its tasks: stop the group and settle the clock before it goes.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "server/link/robot_listener.hpp"
#include "sim_robot/robot/simulated_robot.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {

class VirtualRobot {
 public:
  VirtualRobot(boost::asio::io_context& loop, runtime::Clock& clock, runtime::TaskGroup& tasks,
               sim_robot::SimulatedRobotConfig config);

  void dial(link::RobotListener& listener);
  void cut();                // the link ends for both sides
  void stall(bool stalled);  // half-open: nothing arrives on either side

  const sim_robot::SimulatedRobot& simulated() const { return robot_; }
  sim_robot::World& world() { return robot_.world(); }  // for faults while it runs
  const robot_fw::Robot& core() const { return robot_.core(); }
  const sim_robot::SimulatedRobotConfig& config() const { return robot_.config(); }
  bool connected() const { return link_ != nullptr; }
  // When sample `seq` is made, on the test's clock.
  std::int64_t tick_at_us(std::uint64_t seq) const { return booted_at_us_ + static_cast<std::int64_t>(seq) * 10'000; }

  bool redial = true;             // dials again 0.5 s after the link has ended
  std::function<void()> on_tick;  // after each one, for who records the simulated world

 private:
  struct Link;

  boost::asio::awaitable<void> tick();
  boost::asio::awaitable<void> read(std::shared_ptr<Link> link);
  boost::asio::awaitable<void> write(std::shared_ptr<Link> link);
  boost::asio::awaitable<void> dial_later();
  void pump();
  void lose(const std::shared_ptr<Link>& link);
  std::uint64_t now_us() const { return static_cast<std::uint64_t>(clock_.steady_us() - booted_at_us_); }

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  runtime::TaskGroup& tasks_;
  sim_robot::SimulatedRobot robot_;
  std::int64_t booted_at_us_;
  link::RobotListener* listener_ = nullptr;
  std::shared_ptr<Link> link_;  // shared with the tasks that read and write it
};

}  // namespace server
