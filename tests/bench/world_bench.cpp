// What a tick of the simulated robot costs: the world alone, one robot with everything on, and one of a fleet.
#include <benchmark/benchmark.h>

#include <array>
#include <memory>
#include <vector>

#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {
namespace {

SimulatedRobotConfig with_everything(std::uint64_t seed) {
  SimulatedRobotConfig config;
  config.world.motor = {.dead_zone_duty = 0.03, .time_constant_s = 0.02};
  config.world.battery = kCr123a;
  config.world.vessel.emplace();
  config.world.vessel->pump.mean_flow_m3_s = 0.1 * kPaperFlowM3S;
  config.world.glucose.patches = {{.position_m = 0.5, .mixing_m2_s = 1e-5, .decay_s = 100}};
  config.world.imu.emplace();
  config.world.electrode = kDs550;
  config.world.seed = seed;
  return config;
}

// A robot and the least of a station: what it sends is encoded, taken and acknowledged.
class LinkedRobot {
 public:
  explicit LinkedRobot(std::uint64_t seed) : robot_(with_everything(seed)) {
    robot_.link_opened(0);
    drain();
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    send(frame);
    protocol::StationFrame order = rheonaut_StationFrame_init_zero;
    order.which_body = rheonaut_StationFrame_command_tag;
    order.body.command.command_id = 1;
    order.body.command.boot_id = robot_.config().boot_id;
    order.body.command.valid_until_robot_us = 1'000'000;
    order.body.command.which_action = rheonaut_Command_set_mode_tag;
    order.body.command.action.set_mode = {rheonaut_MODE_AUTO, true, 0.3F};
    send(order);
  }
  void step() {
    robot_.step();
    drain();
    if (++ticks_ % 20 != 0) return;
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_heartbeat_tag;
    frame.body.heartbeat.durable_next_seq = ticks_ - 10;
    send(frame);
  }
  std::size_t sent_bytes() const { return sent_bytes_; }

 private:
  void drain() {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
    while (const std::size_t size = robot_.transmit(buffer.data(), buffer.size(), robot_.robot_time_us())) {
      sent_bytes_ += size;
    }
  }
  void send(const protocol::StationFrame& frame) {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
    const std::size_t size = protocol::write_frame(frame, buffer.data(), buffer.size());
    robot_.receive({buffer.data(), size}, robot_.robot_time_us());
  }

  SimulatedRobot robot_;
  std::uint64_t ticks_ = 0;
  std::size_t sent_bytes_ = 0;
};

void step_world(benchmark::State& state, const WorldConfig& config) {
  World world{config};
  double duty = 0.3;
  for (auto _ : state) {
    world.step(duty);
    benchmark::DoNotOptimize(world.read(0));
    benchmark::DoNotOptimize(duty = -duty);
  }
}

void plain_world(benchmark::State& state) { step_world(state, {}); }
BENCHMARK(plain_world)->Unit(benchmark::kNanosecond);

void world_with_everything(benchmark::State& state) { step_world(state, with_everything(1).world); }
BENCHMARK(world_with_everything)->Unit(benchmark::kNanosecond);

void nonlinear_world(benchmark::State& state) {
  WorldConfig config;
  config.plant = fluid("water_nonlinear");
  step_world(state, config);
}
BENCHMARK(nonlinear_world)->Unit(benchmark::kNanosecond);

void one_robot(benchmark::State& state) {
  LinkedRobot robot{1};
  for (auto _ : state) robot.step();
  state.counters["bytes_per_tick"] =
      benchmark::Counter(static_cast<double>(robot.sent_bytes()), benchmark::Counter::kAvgIterations);
}
BENCHMARK(one_robot)->Unit(benchmark::kNanosecond);

// A tick of each robot in turn; the time is per robot and tick.
void robot_of_a_fleet(benchmark::State& state) {
  std::vector<std::unique_ptr<LinkedRobot>> fleet;
  for (int k = 0; k < state.range(0); ++k) fleet.push_back(std::make_unique<LinkedRobot>(k + 1));
  std::size_t next = 0;
  for (auto _ : state) {
    fleet[next]->step();
    next = next + 1 < fleet.size() ? next + 1 : 0;
  }
}
BENCHMARK(robot_of_a_fleet)->Arg(1000)->Unit(benchmark::kNanosecond);

}  // namespace
}  // namespace sim_robot
