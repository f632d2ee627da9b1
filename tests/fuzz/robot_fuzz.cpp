// Drives a robot with any bytes: ticks, connections, whole and broken frames, in any order and at any time.
//
//   input     := config operation*
//   config    := byte             duty range, reset cause, whether all samples are counted at the end
//   operation := byte argument*   the low four bits say which one, the others how
// What must hold is in watched_robot.hpp. The last operation is followed by a few ticks.
#include <cstdlib>
#include <memory>

#include "tests/fuzz/station_frames.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/fuzz/watched_robot.hpp"
#include "tests/robot_fw/memory_storage.hpp"

namespace fuzz {
namespace {

constexpr std::uint64_t kBootId = 1311768467463790320;  // as in the golden frames, so that they are for this robot
constexpr std::uint64_t kTickUs = 10'000;

class Session {
 public:
  explicit Session(ByteSource source) : source_(source), choice_(source_.byte()) {
    boot(rheonaut_RESET_CAUSE_POWER_ON);
  }

  void run() {
    while (!source_.empty()) operate(source_.byte());
    for (int i = 0; i < 3; ++i) tick();
    robot_->transmit_all();
    if (choice_ >= 0xC0) robot_->expect_every_sample();
  }

 private:
  // The storage stays what it is.
  void boot(protocol::ResetCause cause, std::uint64_t restored_emergency_id = 0) {
    robot_fw::RobotConfig config;
    config.robot_id = "swimmer-1";
    config.token = choice_ & 1 ? "a token" : "";
    config.firmware_version = "0.1.0";
    config.boot_id = kBootId + boots_++;
    config.reset_cause = cause;
    if (choice_ & 2) config.duty_min = 0;
    if (choice_ & 4) config.duty_max = 0.6F;
    config.samples_per_frame = choice_ & 8 ? 25 : 5;
    config.restored_emergency_id = restored_emergency_id;
    if (restored_emergency_id != 0) config.restored_emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
    config.storage = choice_ & 16 ? &storage_ : nullptr;
    robot_ = std::make_unique<WatchedRobot>(config);
    waiting_.clear();
  }
  void reboot(std::uint8_t choice) {
    const std::uint64_t latch = choice & 1 ? robot_->emergency_id() : 0;
    for (auto& [key, value] : storage_.values) {  // what flash memory does at times
      if (choice & 2 && !value.empty()) value[source_.byte() % value.size()] ^= source_.byte();
      if (choice & 4) value.resize(source_.byte());
    }
    boot(static_cast<protocol::ResetCause>(choice / 8 % 6), latch);
  }

  void operate(std::uint8_t operation) {
    const std::uint8_t choice = operation >> 4;
    switch (operation % 16) {
      case 0:
      case 1:
        for (int i = 0; i <= choice; ++i) tick();
        return;
      case 2:
        for (int i = 0; i <= choice * 16; ++i) tick(), choice & 1 ? robot_->transmit_all() : void();
        return;
      case 3: return odd_tick(choice);
      case 4: waiting_.clear(); return robot_->open();
      case 5: waiting_.clear(); return robot_->close();
      case 6: return say(source_.bytes(choice == 14 ? SIZE_MAX : 1U + choice * 16U), choice);
      case 7: return say(welcome(source_, known()), choice);
      case 8: return say(heartbeat(source_, known()), choice);
      case 9:
      case 10: return say(frame_of(command(source_, known())), choice);
      case 11: return deliver_all(), robot_->order(command(source_, known()));
      case 12: return void(robot_->transmit(source_.number<std::uint16_t>() % (protocol::kMaxFramedBytes + 2)));
      case 13: return robot_->transmit_all();
      case 14: return robot_->pass(std::uint64_t{source_.byte()} << (choice * 2));
      default: return choice == 15 ? reboot(source_.byte()) : set_up_link(choice);
    }
  }

  KnownOfRobot known() const { return {robot_->boot_id(), robot_->now_us(), robot_->made(), robot_->emergency_id()}; }
  // So that a byte opens the way to what lies behind the welcome.
  void set_up_link(std::uint8_t choice) {
    waiting_.clear();
    robot_->open();
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    frame.body.welcome.samples_per_frame = choice;
    say(frame, 0);
  }

  void say(const protocol::StationFrame& frame, std::uint8_t choice) {
    std::uint8_t bytes[protocol::kMaxFramedBytes];
    say({bytes, protocol::write_frame(frame, bytes, sizeof bytes)}, choice);
  }
  // At once, byte by byte, in two parts with a tick between, or with what is said next.
  void say(protocol::Bytes bytes, std::uint8_t choice) {
    waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
    switch (choice % 4) {
      case 0: return deliver_all();
      case 1:
        while (!waiting_.empty()) deliver(1);
        return;
      case 2: return deliver(waiting_.size() / 2), tick(), deliver_all();
      default: return;
    }
  }
  void deliver_all() { deliver(waiting_.size()); }
  void deliver(std::size_t size) {
    const std::vector<std::uint8_t> front(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(size));
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(size));
    robot_->receive({front.data(), front.size()});
  }

  // The motor moves the robot by a lag of first order.
  void tick() {
    motion_.velocity_m_s += 0.1F * (0.1F * robot_->duty() - motion_.velocity_m_s);
    motion_.position_m += 0.01F * motion_.velocity_m_s;
    robot_fw::Inputs inputs;
    inputs.known_motion = motion_;
    inputs.acceleration_is_valid = true;
    inputs.impedance_mv = impedance_mv_;
    inputs.supply_mv = 7400;
    inputs.robot_time_us = robot_->now_us() + kTickUs;
    robot_->tick(inputs, 0.01F);
  }
  void odd_tick(std::uint8_t choice) {
    robot_fw::Inputs inputs = robot_->last_inputs();
    const std::uint8_t what = source_.byte();
    if (choice & 1) inputs.known_motion = robot_fw::Motion{source_.value(), source_.value(), source_.value()};
    if (choice & 2) motion_.position_m = source_.value();
    if (choice & 4) inputs.known_motion.reset();
    if (what & 1) inputs.acceleration_counts = source_.number<std::int16_t>();
    if (what & 2) inputs.acceleration_is_valid = !inputs.acceleration_is_valid;
    if (what & 4) inputs.impedance_mv = impedance_mv_ = source_.value() * 200;
    if (what & 8) inputs.supply_mv = source_.value();
    if (what & 16) inputs.tick_us = source_.number<std::uint32_t>();
    const std::uint64_t steps_us[] = {0, 1, 10'000, 12'000, 16'000, 50'000, 700'000, 6'000'000};
    inputs.robot_time_us = robot_->now_us() + steps_us[what >> 5];
    if (choice & 8) inputs.robot_time_us -= std::min<std::uint64_t>(inputs.robot_time_us, source_.byte() * 100'000ULL);
    robot_->tick(inputs, what & 8 ? source_.value() : 0.01F);
    if (!std::isfinite(motion_.position_m)) motion_.position_m = 0;
    if (!std::isfinite(impedance_mv_)) impedance_mv_ = 175;
  }

  ByteSource source_;
  std::uint8_t choice_;
  robot_fw::MemoryStorage storage_;
  std::uint64_t boots_ = 0;
  robot_fw::Motion motion_;
  float impedance_mv_ = 175;
  std::vector<std::uint8_t> waiting_;  // said, not yet delivered
  std::unique_ptr<WatchedRobot> robot_;
};

}  // namespace
}  // namespace fuzz

int fuzz::robot(const std::uint8_t* data, std::size_t size) {
  fuzz::Session{fuzz::ByteSource{{data, size}}}.run();
  return 0;
}
