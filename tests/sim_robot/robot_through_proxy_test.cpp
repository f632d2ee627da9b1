// A robot in real time behind the proxy: it keeps its link, or comes back.
#include "tests/sim_robot/proxy_fixture.hpp"

namespace sim_robot {
namespace {

// The least of a station behind the proxy: it welcomes, and answers telemetry with a sign of life.
class RobotThroughProxy : public ProxyTest {
 protected:
  void begin(std::chrono::milliseconds handshake = {}, std::vector<TimedFault> faults = {}) {
    start();
    accept();
    const auto& at = proxy->endpoint();
    SimulatedRobotConfig config;
    config.boot_id = random_boot_id();
    robot.emplace(
        loop, config, StationAddress{"127.0.0.1", std::to_string(at.port())},
        [this](const std::string& line) { log.push_back(line); }, handshake, std::move(faults), &*proxy);
    // The robot runs until the loop has gone; its frame is destroyed with the loop.
    asio::co_spawn(loop, robot->run(), [](const std::exception_ptr&) {});
    ASSERT_TRUE(run_until([&] { return robot->robot().core().link_up() && samples > 5; }));
  }
  ~RobotThroughProxy() override {
    for (auto& end : ends) end->socket.close();
    if (proxy) proxy->stop();
    target.close();
    loop.run_for(50ms);
    loop.stop();  // the robot dials for ever
  }
  void accept() {
    End& end = new_end();
    target.async_accept(end.socket, [this, &end](const boost::system::error_code& error) {
      if (error) return;
      ++connections;
      reader.reset();
      read(end);
      accept();
    });
  }
  void read(End& end) {
    end.socket.async_read_some(asio::buffer(end.bytes), [this, &end](const auto& error, std::size_t size) {
      if (error) {
        end.ended = error;
        return;
      }
      protocol::Bytes input{reinterpret_cast<const std::uint8_t*>(end.bytes.data()), size};
      while (!input.empty() && reader.push(input) == protocol::FrameReader::State::complete) {
        if (const auto frame = protocol::decode_robot_frame(reader.payload())) answer(end, *frame);
      }
      read(end);
    });
  }
  void answer(End& end, const protocol::RobotFrame& received) {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_heartbeat_tag;
    if (received.which_body == rheonaut_RobotFrame_hello_tag) {
      frame.which_body = rheonaut_StationFrame_welcome_tag;
      frame.body.welcome.protocol_version = protocol::kProtocolVersion;
      frame.body.welcome.link_timeout_ms = link_timeout_ms;
    }
    if (received.which_body == rheonaut_RobotFrame_telemetry_tag) ++samples;
    if (received.which_body == rheonaut_RobotFrame_hello_tag) hello = received.body.hello;
    if (received.which_body == rheonaut_RobotFrame_status_tag) missed_ticks = received.body.status.missed_ticks;
    std::array<std::uint8_t, protocol::kMaxFramedBytes> out;
    const std::size_t size = protocol::write_frame(frame, out.data(), out.size());
    boost::system::error_code ignored;
    asio::write(end.socket, asio::buffer(out, size), ignored);
  }
  std::uint64_t inject(const std::string& json) {
    return robot->faults().inject(parse_fault_json(json), robot->faulty());
  }
  // The robot's next connection is up and telemetry comes.
  bool comes_back() { return comes_back_after(connections); }
  bool comes_back_after(int before) {
    if (!run_until([&] { return connections > before; })) return false;
    const int received = samples;
    return run_until([&] { return robot->robot().core().link_up() && samples > received + 5; });
  }

  // Frames on their way arrive, also on a busy machine.
  void settle() {
    loop.run_for(50ms);
    while (loop.poll() > 0) continue;
  }

  protocol::FrameReader reader;
  std::uint32_t link_timeout_ms = 5000;  // of the next connection: it outlives a stall of the machine
  int connections = 0, samples = 0;
  protocol::Hello hello = rheonaut_Hello_init_zero;
  std::uint32_t missed_ticks = 0;
  std::optional<RobotClient> robot;
};

TEST_F(RobotThroughProxy, ComesBackAfterACutAResetAndHalfOpen) {
  begin();
  const auto boot_id = hello.boot_id;
  proxy->control("cut 3");
  EXPECT_TRUE(comes_back());
  proxy->control("reset");
  EXPECT_TRUE(comes_back());
  EXPECT_FALSE(said("silent"));
  EXPECT_EQ(hello.boot_id, boot_id);
  link_timeout_ms = 300;
  proxy->control("cut");
  EXPECT_TRUE(comes_back());
  proxy->control("half-open");
  EXPECT_TRUE(comes_back());
  EXPECT_TRUE(said("the station is silent"));
}

TEST_F(RobotThroughProxy, KeepsItsLinkSplitDelayedAndThrottled) {
  begin();
  for (const char* fault : {"split 1", "delay 100", "jitter 50", "throttle 20000"}) {
    EXPECT_EQ(proxy->control(fault).substr(0, 3), "ok:");
    const int received = samples;
    ASSERT_TRUE(run_until([&] { return samples > received + 15; })) << fault;
  }
  EXPECT_EQ(connections, 1);
  EXPECT_TRUE(robot->robot().core().link_up());
}

TEST_F(RobotThroughProxy, ComesBackAfterAnOutage) {
  link_timeout_ms = 300;
  begin();
  proxy->control("outage 600");
  ASSERT_TRUE(run_until([&] { return robot->robot().core().link_lost(); }));
  proxy->control("outage 0.1");  // it ends by itself, and not before the robot has noticed it
  EXPECT_TRUE(comes_back());
  EXPECT_FALSE(robot->robot().core().link_lost());
}

TEST_F(RobotThroughProxy, ABrownOutLeavesItsConnectionOpenAndComesBackLatched) {
  begin();
  const auto boot_id = hello.boot_id;
  robot->reboot({rheonaut_RESET_CAUSE_BROWN_OUT, 0.3, false});
  EXPECT_EQ(proxy->open_connections(), 1u);
  ASSERT_TRUE(run_until([&] { return ends.front()->ended == asio::error::connection_reset; })) << "when it is back";
  EXPECT_TRUE(comes_back());
  EXPECT_NE(hello.boot_id, boot_id);
  EXPECT_EQ(hello.reset_cause, rheonaut_RESET_CAUSE_BROWN_OUT);
  EXPECT_EQ(hello.mode, rheonaut_MODE_EMERGENCY);
}

TEST_F(RobotThroughProxy, AScenarioRebootsItAndResetsItsLink) {
  const Scenario scenario = parse_scenario(R"(
[[faults]]
at_s = 0.5
fault = "link_reset"
[[faults]]
at_s = 2.5
fault = "reboot"
cause = "watchdog"
off_for_s = 0.3
)",
                                           "reboot_and_reset.toml");
  begin({}, scenario.faults);
  const auto boot_id = hello.boot_id;
  EXPECT_TRUE(comes_back_after(1));
  if (robot->life().boots() == 1) EXPECT_EQ(hello.boot_id, boot_id);  // a stall may bring both faults at once
  EXPECT_TRUE(said("at 0.5 s: link_reset"));
  ASSERT_TRUE(run_until([&] { return robot->life().boots() == 2; }));
  ASSERT_TRUE(run_until([&] { return hello.boot_id != boot_id; }));
  EXPECT_EQ(hello.reset_cause, rheonaut_RESET_CAUSE_WATCHDOG);
  EXPECT_EQ(hello.mode, rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(robot->faults().passed_over(), 0u);
}

TEST_F(RobotThroughProxy, AnOutageOnDemandLastsUntilItIsWithdrawn) {
  link_timeout_ms = 300;
  begin();
  const auto id = inject(R"({"fault":"link_outage"})");
  ASSERT_TRUE(run_until([&] { return robot->robot().core().link_lost(); }));
  const int before = connections;
  EXPECT_TRUE(robot->faults().withdraw(id, robot->faulty()));
  EXPECT_TRUE(comes_back_after(before));
  EXPECT_FALSE(robot->robot().core().link_lost());
}

TEST_F(RobotThroughProxy, AHalfOpenOnDemandIsWithdrawnBeforeItIsNoticed) {
  begin();
  const auto id = inject(R"({"fault":"link_half_open","direction":"up"})");
  loop.run_for(100ms);
  const int received = samples;
  EXPECT_TRUE(robot->faults().withdraw(id, robot->faulty()));
  ASSERT_TRUE(run_until([&] { return samples > received + 5; }));
  EXPECT_EQ(connections, 1);
}

TEST_F(RobotThroughProxy, SettingsOnDemandEndByThemselvesAndLeaveTheOthers) {
  begin();
  inject(R"({"fault":"link_delay","delay_s":0.05,"direction":"up","for_s":0.2})");
  const auto id = inject(R"({"fault":"link_throttle","bytes_per_s":20000})");
  EXPECT_EQ(proxy->impairments().up.delay_s, 0.05);
  EXPECT_EQ(proxy->impairments().down.delay_s, 0);
  ASSERT_TRUE(run_until([&] { return robot->faults().in_force().size() == 1; }));
  EXPECT_EQ(proxy->impairments().up.delay_s, 0);
  EXPECT_EQ(proxy->impairments().down.bytes_per_s, 20'000);
  robot->faults().withdraw(id, robot->faulty());
  EXPECT_EQ(proxy->impairments().down.bytes_per_s, 0);
  EXPECT_EQ(connections, 1);
}

TEST_F(RobotThroughProxy, ABlockedLoopSaysNothingMissesTicksAndGoesOn) {
  begin();
  inject(R"({"fault":"block","for_s":0.4})");
  settle();
  const int received = samples;
  ASSERT_TRUE(run_until([&] { return robot->faults().in_force().empty(); }));
  EXPECT_LE(samples, received + 1);
  ASSERT_TRUE(run_until([&] { return missed_ticks > 0; }));
  EXPECT_GE(missed_ticks, 35u);
  EXPECT_EQ(connections, 1);
}

TEST_F(RobotThroughProxy, ABlockForEverEndsWhenTheWatchdogBites) {
  begin();
  const auto boot_id = hello.boot_id;
  inject(R"({"fault":"block"})");
  loop.run_for(100ms);
  EXPECT_TRUE(robot->life().is_blocked());
  inject(R"({"fault":"reboot","cause":"watchdog","off_for_s":0.1})");
  ASSERT_TRUE(run_until([&] { return hello.boot_id != boot_id; }));
  EXPECT_EQ(hello.reset_cause, rheonaut_RESET_CAUSE_WATCHDOG);
  EXPECT_FALSE(robot->life().is_blocked());
}

TEST_F(RobotThroughProxy, AClockThatDriftsOnDemandIsFastAndThenRightAgain) {
  begin();
  inject(R"({"fault":"clock_drift","drift_ppm":100000,"for_s":0.5})");
  ASSERT_TRUE(run_until([&] { return robot->faults().in_force().empty(); }));
  const RobotLife& life = robot->life();
  const auto ahead_us = [&life] { return static_cast<std::int64_t>(life.robot_clock_us() - life.true_us()); };
  const std::int64_t ahead_then_us = ahead_us();
  EXPECT_GE(ahead_then_us, 49'000);
  const int received = samples;
  ASSERT_TRUE(run_until([&] { return samples > received + 5; }));
  EXPECT_NEAR(static_cast<double>(ahead_us()), static_cast<double>(ahead_then_us), 2);
}

TEST_F(RobotThroughProxy, AHandshakeMissesTicks) {
  begin(400ms);
  ASSERT_TRUE(run_until([&] { return missed_ticks > 0; }));
  EXPECT_GE(missed_ticks, 35u);
  EXPECT_EQ(connections, 1);
}

}  // namespace
}  // namespace sim_robot
