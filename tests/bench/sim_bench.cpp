// How fast the simulated robot is: a tick of one robot, and of robots in a fleet.
//
//   build/release/bin/sim_bench --benchmark_repetitions=9 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>

#include <array>
#include <memory>
#include <vector>

#include "sim_robot/fleet/replay.hpp"
#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {
namespace {

constexpr std::uint64_t kAckEveryTicks = 20;  // a station commits some times a second

SimulatedRobotConfig perfect() { return {}; }

// Vessel and pump, glucose in the way, battery, accelerometer and electrode.
SimulatedRobotConfig everything(std::uint64_t seed = 1) {
  SimulatedRobotConfig config;
  config.boot_id = seed;
  config.world.battery = kCr123a;
  config.world.vessel.emplace();
  config.world.vessel->pump.mean_flow_m3_s = kPaperFlowM3S;
  config.world.glucose.patches = {{.position_m = 0.3, .edge_m = 0.01, .mixing_m2_s = 1e-6}};
  config.world.imu.emplace();
  config.world.electrode = kDs550;
  config.world.seed = seed;
  return config;
}

protocol::StationFrame welcome() {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  frame.body.welcome.samples_per_frame = 10;
  return frame;
}

// A robot with a link: what it sends is encoded and thrown away, what it made is acknowledged now and then.
class LinkedRobot {
 public:
  explicit LinkedRobot(const SimulatedRobotConfig& config) : robot_(config) {
    robot_.link_opened(0);
    drain();
    receive(welcome());
  }

  void prefetch() const { robot_.prefetch(); }
  void tick() {
    robot_.step();
    drain();
    if (++ticks_ % kAckEveryTicks == 0) acknowledge();
  }

 private:
  void drain() {
    while (robot_.transmit(bytes_.data(), bytes_.size(), robot_.robot_time_us()) > 0) benchmark::DoNotOptimize(bytes_);
  }
  void acknowledge() {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_heartbeat_tag;
    frame.body.heartbeat.durable_next_seq = ticks_;
    receive(frame);
  }
  void receive(const protocol::StationFrame& frame) {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
    const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
    robot_.receive({bytes.data(), size}, robot_.robot_time_us());
  }

  SimulatedRobot robot_;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes_{};
  std::uint64_t ticks_ = 0;
};

void tick(benchmark::State& state, const SimulatedRobotConfig& config) {
  LinkedRobot robot{config};
  for (auto _ : state) robot.tick();
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(tick, everything, everything());
BENCHMARK_CAPTURE(tick, perfect_sensor, perfect());

void world_step(benchmark::State& state, const WorldConfig& config) {
  World world{config};
  std::uint64_t time_us = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(world.read(time_us += SimulatedRobot::kPeriodUs));
    world.step(0.01);
  }
}
BENCHMARK_CAPTURE(world_step, everything, everything().world);
BENCHMARK_CAPTURE(world_step, perfect_sensor, perfect().world);

// One tick of each of so many robots; items are ticks.
void fleet_tick(benchmark::State& state) {
  std::vector<std::unique_ptr<LinkedRobot>> robots;
  for (int i = 0; i < state.range(0); ++i) {
    robots.push_back(std::make_unique<LinkedRobot>(everything(static_cast<std::uint64_t>(i) + 1)));
  }
  for (auto _ : state) {
    for (std::size_t i = 0; i < robots.size(); ++i) {
      robots[(i + 1) % robots.size()]->prefetch();  // as a fleet does
      robots[i]->tick();
    }
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(fleet_tick)->Arg(1)->Arg(100)->Arg(1000)->Unit(benchmark::kMicrosecond);

// One frame of 10 samples of a replayed robot.
void replay_frame(benchmark::State& state) {
  const Recording recording = make_recording(5, 10, 1);
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
  std::uint64_t number = 0;
  for (auto _ : state) {
    const Recording::Head head{number * 100'000, 10'000, number * 10, false};
    benchmark::DoNotOptimize(recording.write(number, head, bytes.data(), bytes.size()));
    ++number;
  }
}
BENCHMARK(replay_frame);

// What every tick is compared with: the smallest plant that can be, one complex number turned 144 times.
void bare_loop(benchmark::State& state) {
  double real = 1, imag = 0;
  for (auto _ : state) {
    for (int i = 0; i < 144; ++i) {
      const double next = 0.995 * real - 0.0998 * imag;
      imag = 0.995 * imag + 0.0998 * real;
      real = next;
    }
    benchmark::DoNotOptimize(real += 1e-300);
  }
}
BENCHMARK(bare_loop);

}  // namespace
}  // namespace sim_robot
