// How long the robot's motor still runs after something has failed, and how far the body goes: the real core in its
// simulated world, in virtual time, so that the figures are exact and every machine prints the same ones.
//
// Usage: safety_cases [REPETITIONS]. Prints rows of the table in docs/safety.md, and fails when a reaction takes longer
// than that page promises. The reaction is from the failure to duty 0 at the
// motor, the way is that of the true body from the failure until it is slower than 1 mm/s. In each repetition the
// failure comes at a random moment within a tick of 10 ms, after a random time of driving at duty 1 in the fluid of
// (29).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "sim_robot/lab/station_peer.hpp"

namespace {

using sim_robot::SimulatedRobot;

constexpr double kRestMS = 0.001;
constexpr int kLongestTicks = 3000;

struct Trial {
  explicit Trial(bool has_imu) : robot(config(has_imu)) {
    station.welcome.samples_per_frame = 1;
    station.welcome.link_timeout_ms = 1000;
    station.connect();
    station.run(50);
    station.attentive = false;  // tick() sends its heartbeats
  }

  static sim_robot::SimulatedRobotConfig config(bool has_imu) {
    sim_robot::SimulatedRobotConfig config;
    if (has_imu) config.world.imu.emplace();
    return config;
  }

  void tick() {
    if (renews && ++since_renewal == 15) {  // 150 ms, as the page does
      station.send(sim_robot::renew_lease());
      since_renewal = 0;
    }
    if (is_attentive && ++since_heartbeat == 20) {  // 200 ms, as a station that has nothing to acknowledge
      station.send_heartbeat(rheonaut_StationHeartbeat_init_zero);
      since_heartbeat = 0;
    }
    if (hangs) {
      robot.skip(1);
    } else {
      station.step();
    }
  }

  // Orders that the robot refuses would make a row of nothing.
  void order(const protocol::Command& command) {
    const std::uint64_t id = station.send(command);
    tick();
    const auto ack = station.ack_of(id);
    if (!ack || ack->result != rheonaut_COMMAND_RESULT_ACCEPTED) throw std::runtime_error("the robot refused an order");
  }

  SimulatedRobot robot;
  sim_robot::StationPeer station{robot};
  bool renews = false, is_attentive = true, hangs = false;
  int since_renewal = 0, since_heartbeat = 0;
  float limit_m = 0.3F;
};

struct Case {
  std::string row, what;
  double bound_ms;  // what docs/safety.md promises
  bool has_imu = false;
  bool in_auto = false;
  std::function<void(Trial&)> before = [](Trial&) {};
  std::function<void(Trial&)> fails;
  // Instead of a random time: since when the world shows it, in s; negative: not yet.
  std::function<double(const Trial&)> failed_since_s = nullptr;
  bool acts_at_once = false;  // in the call that brings it, not in the next tick
};

struct Figures {
  std::vector<double> reaction_ms, way_mm;
};

void measure(const Case& now, unsigned seed, Figures& into) {
  std::mt19937 random{seed};
  Trial trial{now.has_imu};
  trial.limit_m += std::uniform_real_distribution{0.0F, 0.01F}(random);
  now.before(trial);
  if (now.in_auto) {
    trial.order(sim_robot::set_auto(1));
  } else {
    trial.order(sim_robot::set_duty(1));
    trial.renews = true;
  }
  const int driving = std::uniform_int_distribution{now.in_auto ? 40 : 150, now.in_auto ? 90 : 300}(random);
  // The failure comes this long before the next tick, which is the first that can notice it.
  double before_tick_s = std::uniform_real_distribution{0.0, SimulatedRobot::kPeriodS}(random);
  for (int k = 0; now.failed_since_s ? now.failed_since_s(trial) < 0 : k < driving; ++k) {
    if (k > kLongestTicks) throw std::runtime_error("it never failed: " + now.what);
    trial.tick();
  }
  if (std::fabs(trial.robot.motor_duty()) < 0.5) throw std::runtime_error("the motor does not run: " + now.what);
  if (now.failed_since_s) before_tick_s = now.failed_since_s(trial);
  if (now.acts_at_once) before_tick_s = 0;
  const auto& world = trial.robot.world();
  const double from_m = world.position_m() - world.velocity_m_s() * before_tick_s;
  now.fails(trial);
  int on = 0;
  // Between two ticks a stop acts at once; else the duty of the tick before goes on until a tick ends it.
  while (trial.robot.core().duty() != 0 && trial.robot.motor_duty() != 0) {
    if (++on > kLongestTicks) throw std::runtime_error("the motor never stops: " + now.what);
    trial.tick();
  }
  // Of the last tick the motor has run none: a tick decides about the time behind it.
  into.reaction_ms.push_back(1000 * (before_tick_s + SimulatedRobot::kPeriodS * std::max(0, on - 1)));
  for (int k = 0; std::fabs(world.velocity_m_s()) >= kRestMS; ++k) {
    if (k > kLongestTicks) throw std::runtime_error("the body never rests: " + now.what);
    trial.tick();
  }
  into.way_mm.push_back(1000 * std::fabs(world.position_m() - from_m));
}

double percentile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[std::min(static_cast<std::size_t>(share * static_cast<double>(values.size())), values.size() - 1)];
}

std::string three(const std::vector<double>& values) {
  char text[96];
  std::snprintf(text, sizeof text, "%.0f / %.0f / %.0f", percentile(values, 0.5), percentile(values, 0.99),
                percentile(values, 1));
  return text;
}

std::vector<Case> cases() {
  using namespace sim_robot;
  const auto fault = [](SensorFault of) {
    return [of](Trial& trial) { trial.robot.world().set_fault(Sensor::accelerometer, of); };
  };
  return {
      {"1.9", "a stop arrives at the robot", 0, false, false, [](Trial&) {},
       [](Trial& trial) { trial.station.send(emergency_stop()); }, nullptr, true},
      {"1.11", "a switch cuts the motor's supply, until the robot has sensed it", 10, false, false, [](Trial&) {},
       [](Trial& trial) { trial.robot.world().cut_motor_supply(true); }},
      {"2.1", "auto: nothing comes from the station any more, the connection stays open", 1010, false, true,
       [](Trial&) {}, [](Trial& trial) { trial.is_attentive = false; }},
      {"2.1", "auto: the station was killed, its connections close", 1010, false, true, [](Trial&) {},
       [](Trial& trial) { trial.station.disconnect(); }},
      {"2.2", "a held duty: who holds it renews its lease no more", 510, false, false, [](Trial&) {},
       [](Trial& trial) { trial.renews = false; }},
      {"2.8", "the robot's program hangs", 50, false, false, [](Trial&) {}, [](Trial& trial) { trial.hangs = true; }},
      {"4.1", "the robot is beyond a position limit", 10, false, false,
       [](Trial& trial) { trial.order(set_parameter("position_limit_max_m", trial.limit_m)); }, [](Trial&) {},
       [](const Trial& trial) {
         const auto& world = trial.robot.world();
         return (world.position_m() - static_cast<double>(trial.limit_m)) / std::max(world.velocity_m_s(), 1e-3);
       }},
      {"5.1", "auto: the accelerometer gives no readings any more", 260, true, true, [](Trial&) {},
       fault({SensorFaultKind::missing, 0})},
      {"5.1", "auto: the accelerometer gives one reading for ever", 1010, true, true, [](Trial&) {},
       fault({SensorFaultKind::stuck, 0})},
      {"5.1", "auto: the accelerometer is out of range", 60, true, true, [](Trial&) {},
       fault({SensorFaultKind::offset, 60})},
      {"5.2", "the robot's clock goes back by a second", 10, false, false, [](Trial&) {},
       [](Trial& trial) { trial.robot.jump_clock(-1'000'000); }},
  };
}

}  // namespace

int main(int argc, char** argv) try {
  const int repetitions = argc > 1 ? std::atoi(argv[1]) : 1000;
  if (repetitions < 1) throw std::invalid_argument("usage: safety_cases [REPETITIONS], a number from 1 on");
  for (const Case& now : cases()) {
    Figures figures;
    for (int i = 0; i < repetitions; ++i) measure(now, static_cast<unsigned>(1 + i), figures);
    std::printf("| %s | %s | %d | %s | %s |\n", now.row.c_str(), now.what.c_str(), repetitions,
                three(figures.reaction_ms).c_str(), three(figures.way_mm).c_str());
    std::fflush(stdout);
    if (percentile(figures.reaction_ms, 1) > now.bound_ms + 1e-6)
      throw std::runtime_error("over its bound: " + now.what);
  }
  return EXIT_SUCCESS;
} catch (const std::exception& error) {
  std::fprintf(stderr, "safety_cases: %s\n", error.what());
  return EXIT_FAILURE;
}
