// A simulated robot whose clock is fast or slow, on a slow and uneven network: the true UTC of every stored sample lies
// within what the station states of it.
#include <array>
#include <cmath>
#include <ostream>

#include "sim_robot/lab/impaired_link.hpp"
#include "tests/server/stream_reader.hpp"
#include "tests/system/station_fixture.hpp"

namespace server {
namespace {
namespace asio = boost::asio;

struct Robot {
  const char* name = "";
  double drift_ppm = 0;  // fast is positive
  bool is_far = false;   // its network
};

void PrintTo(const Robot& robot, std::ostream* out) { *out << robot.name; }

sim_robot::LinkOptions network(const Robot& robot) {
  sim_robot::LinkOptions options;
  options.up = {.delay_s = 0.0003, .jitter_s = 0.001};
  options.down = {.delay_s = 0.0001, .jitter_s = 0.001};
  if (robot.is_far) {
    options.up = {.delay_s = 0.060, .jitter_s = 0.080, .loss_probability = 0.01};
    options.down = {.delay_s = 0.005, .jitter_s = 0.020, .loss_probability = 0.01};
  }
  return options;
}

class ClockTest : public SystemTest, public ::testing::WithParamInterface<Robot> {
 protected:
  ClockTest() { tasks.spawn("drifting robot", live()); }

  static sim_robot::SimulatedRobotConfig config() {
    sim_robot::SimulatedRobotConfig config;
    config.clock_drift_ppm = GetParam().drift_ppm;
    return config;
  }

  // UTC, of a time of the robot.
  double truth_us(std::uint64_t robot_time_us) const {
    return static_cast<double>(booted_at_utc_us_) +
           static_cast<double>(robot_time_us) / (1 + GetParam().drift_ppm * 1e-6);
  }
  void outage(double for_s) { link_.outage(for_s, true); }

 private:
  // Its own time passes, and bytes between its network and the station, which has no delay of its own.
  asio::awaitable<void> live() {
    constexpr std::int64_t kStepUs = 1'000;
    for (std::int64_t true_us = kStepUs;; true_us += kStepUs) {
      co_await clock.sleep_until(booted_at_us_ + true_us);
      life_.advance_to(static_cast<std::uint64_t>(true_us));
      link_.exchange();
      if (link_.connections() != connections_) {
        connections_ = link_.connections();
        memory_ = std::make_unique<net::MemoryLink>(loop);
        stream_ = memory_->take_first();
        listener->serve(memory_->take_second());
      }
      if (stream_) exchange_with_station();
    }
  }

  void exchange_with_station() {
    std::array<std::uint8_t, 2048> bytes;
    while (const std::size_t size = link_.receive(bytes.data(), bytes.size())) {
      ASSERT_EQ(stream_->write_now(asio::buffer(bytes.data(), size)), size);
    }
    const net::ByteStream::Read got = stream_->read_now(asio::buffer(bytes));
    ASSERT_EQ(link_.send({bytes.data(), got.size}), got.size);
    if (!got.has_ended && link_.is_open()) return;
    link_.close();
    stream_.reset();
  }

  const std::int64_t booted_at_us_ = clock.steady_us();
  const std::int64_t booted_at_utc_us_ = clock.utc_us();
  sim_robot::RobotLife life_{config()};
  sim_robot::ImpairedLink link_{life_, network(GetParam())};
  int connections_ = 0;
  std::unique_ptr<net::MemoryLink> memory_;
  std::unique_ptr<net::ByteStream> stream_;  // the robot's end
};

TEST_P(ClockTest, NoSampleLiesOutsideOfWhatIsStatedOfItsUtc) {
  ASSERT_TRUE(clock.run_until([this] { return station.find("sim-1") != nullptr && state().clock.valid; }, 5s));
  const storage::RunId run = begin_run();
  clock.run_for(8s);
  outage(5);  // samples from the ring come later, between two exchanges that are far apart
  clock.run_for(20s);
  wait_for(runs->end(run, "")).value();

  int outside = 0;
  double widest_us = 0;
  const std::vector<storage::StoredSample> samples = samples_of(run);
  for (const storage::StoredSample& sample : samples) {
    const double error_us = std::abs(static_cast<double>(sample.utc_us) - truth_us(sample.robot_time_us));
    const auto stated_us = static_cast<double>(sample.clock_uncertainty_us);
    outside += error_us > stated_us;
    widest_us = std::max(widest_us, stated_us);
  }
  EXPECT_GT(samples.size(), 2'500u);
  EXPECT_EQ(outside, 0) << "of " << samples.size();
  RecordProperty("widest_us", std::to_string(widest_us));
  // Half of the longest round trip, and what a clock can drift that is not yet measured.
  EXPECT_LE(widest_us, (GetParam().is_far ? 100'000 : 8'000) + 8'000);
}

INSTANTIATE_TEST_SUITE_P(Robots, ClockTest,
                         ::testing::Values(Robot{"Exact", 0, false}, Robot{"Fast100", 100, false},
                                           Robot{"Slow100", -100, false}, Robot{"Fast300", 300, false},
                                           Robot{"Slow300", -300, false}, Robot{"Fast1000", 1000, false},
                                           Robot{"Slow1000", -1000, false}, Robot{"FarExact", 0, true},
                                           Robot{"FarFast300", 300, true}, Robot{"FarSlow1000", -1000, true}),
                         [](const auto& of) { return std::string{of.param.name}; });

}  // namespace
}  // namespace server
