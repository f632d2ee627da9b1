// Plays each record to a core of its own as it writes it, so that the station can answer.
#include "tests/lx106/recorded_session.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <set>

#include "robot_fw/lx106/replay.hpp"
#include "sim_robot/lab/station_peer.hpp"
#include "sim_robot/world/world.hpp"
#include "tests/lx106/send_turn.hpp"
#include "tests/robot_fw/controllers.hpp"

namespace {

using namespace robot_fw::lx106;

constexpr std::uint64_t kPeriodUs = 10'000;
constexpr double kPeriodS = sim_robot::kTickS;
constexpr std::uint64_t kCommandLifeUs = 2'000'000;
constexpr std::uint64_t kImuSeed = 106;

sim_robot::World on_its_accelerometer() {
  sim_robot::WorldConfig config;
  config.imu.emplace();
  config.seed = kImuSeed;
  return sim_robot::World{config};
}

class Session final : public RecordingSink {
 public:
  explicit Session(const std::string& path) : file_(path, std::ios::binary) {}

  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  void connect(std::uint32_t samples_per_frame);
  void disconnect();
  std::uint64_t send(protocol::Command command);  // execute_at_robot_us: from now

  bool accepted(std::uint64_t command_id) const { return accepted_.contains(command_id); }
  std::uint64_t samples_heard() const { return samples_.size(); }
  std::uint64_t ticks() const { return now_us_ / kPeriodUs; }
  bool has_event(protocol::EventKind kind) const { return events_.contains(kind); }
  const robot_fw::Robot& robot() const { return replay_.robot(); }
  // The file is whole; nothing may be recorded afterwards.
  bool close() {
    file_.close();
    return file_.good();
  }
  bool perfect_sensor = false;

 private:
  void write(const void* from, std::size_t size) override {
    file_.write(static_cast<const char*>(from), static_cast<std::streamsize>(size));
  }
  void play(const Record& record);
  void tick();
  void listen();
  void send(const protocol::StationFrame& frame);
  void on_frame(const protocol::RobotFrame& frame);
  void acknowledge();

  std::ofstream file_;
  Replay replay_;
  sim_robot::World world_ = on_its_accelerometer();
  std::uint64_t now_us_ = 0;
  bool connected_ = false;
  std::uint64_t next_command_id_ = 1000;

  std::set<std::uint64_t> samples_, accepted_;
  std::set<protocol::EventKind> events_;
  std::uint64_t durable_next_seq_ = 0, durable_next_event_seq_ = 0;
};

void Session::play(const Record& record) {
  write_record(*this, record);
  replay_.play(record);
}

void Session::tick() {
  Record record;
  record.now_us = now_us_;
  record.dt_s = static_cast<float>(kPeriodS);
  robot_fw::Inputs& inputs = record.inputs;
  inputs = world_.read(now_us_);
  if (perfect_sensor) {
    inputs.known_motion = {static_cast<float>(world_.position_m()), static_cast<float>(world_.velocity_m_s()),
                           static_cast<float>(world_.acceleration_m_s2())};
  }
  inputs.impedance_mv = 175 + 0.25F * static_cast<float>(ticks() % 8);
  inputs.rssi_dbm = -61;
  inputs.free_memory_bytes = 21'000;
  inputs.tick_us = 150 + static_cast<std::uint32_t>(ticks() % 37);
  play(record);
  world_.step(static_cast<double>(robot().duty()));
  listen();
  now_us_ += kPeriodUs;
  if (connected_) acknowledge();
}

// As a board does in a tick.
void Session::listen() {
  Record record;
  record.kind = RecordKind::transmit;
  record.now_us = now_us_;
  record.size = protocol::kMaxFramedBytes;
  robot_fw::SendTurn turn;
  while (connected_ && turn.goes_on()) {
    play(record);
    protocol::Bytes bytes = replay_.sent();
    turn.sent(bytes.size);
    protocol::FrameReader reader;
    if (reader.push(bytes) != protocol::FrameReader::State::complete) continue;
    if (const auto frame = protocol::decode_robot_frame(reader.payload())) on_frame(*frame);
  }
}

void Session::on_frame(const protocol::RobotFrame& frame) {
  if (frame.which_body == rheonaut_RobotFrame_command_ack_tag) {
    const protocol::CommandAck& ack = frame.body.command_ack;
    if (ack.result == rheonaut_COMMAND_RESULT_ACCEPTED) accepted_.insert(ack.command_id);
  }
  if (frame.which_body == rheonaut_RobotFrame_event_tag) {
    events_.insert(frame.body.event.kind);
    durable_next_event_seq_ = std::max(durable_next_event_seq_, frame.body.event.event_seq + 1);
  }
  if (frame.which_body != rheonaut_RobotFrame_telemetry_tag) return;
  const protocol::Telemetry& batch = frame.body.telemetry;
  for (pb_size_t i = 0; i < batch.position_m_count; ++i) samples_.insert(batch.first_seq + i);
  while (samples_.contains(durable_next_seq_)) ++durable_next_seq_;
}

void Session::connect(std::uint32_t samples_per_frame) {
  Record record;
  record.kind = RecordKind::opened;
  record.now_us = now_us_;
  play(record);
  connected_ = true;
  listen();
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  frame.body.welcome.durable_next_seq = durable_next_seq_;
  frame.body.welcome.durable_next_event_seq = durable_next_event_seq_;
  frame.body.welcome.samples_per_frame = samples_per_frame;
  send(frame);
}

void Session::disconnect() {
  Record record;
  record.kind = RecordKind::closed;
  record.now_us = now_us_;
  play(record);
  connected_ = false;
}

void Session::send(const protocol::StationFrame& frame) {
  Record record;
  record.kind = RecordKind::bytes;
  record.now_us = now_us_;
  const std::size_t size = protocol::write_frame(frame, record.bytes.data(), record.bytes.size());
  record.size = static_cast<std::uint16_t>(size);
  play(record);
}

std::uint64_t Session::send(protocol::Command command) {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = command;
  frame.body.command.command_id = next_command_id_++;
  frame.body.command.boot_id = Replay::kBootId;
  frame.body.command.valid_until_robot_us = now_us_ + kCommandLifeUs;
  if (command.has_execute_at_robot_us) frame.body.command.execute_at_robot_us += now_us_;
  send(frame);
  return frame.body.command.command_id;
}

// Each tick acknowledges; each tenth asks for the time.
void Session::acknowledge() {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  frame.body.heartbeat.durable_next_seq = durable_next_seq_;
  frame.body.heartbeat.durable_next_event_seq = durable_next_event_seq_;
  if (ticks() % 10 == 0) frame.body.heartbeat.station_time_us = now_us_ + 1'000'000'000;
  send(frame);
}

struct Expectations {
  int missing = 0;

  void that(bool holds, const char* what) {
    if (holds) return;
    ++missing;
    std::cerr << "lx106_host: the recorded session lacks: " << what << '\n';
  }
};

// The longest message there is, due half a second later, for which its lease is renewed: from 0.25 to -0.25.
protocol::Command longest_schedule() {
  protocol::Command command = rheonaut_Command_init_zero;
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = 500'000;
  command.which_action = rheonaut_Command_set_duty_schedule_tag;
  rheonaut_SetDutySchedule& schedule = command.action.set_duty_schedule;
  constexpr pb_size_t kEntries = sizeof(schedule.duty) / sizeof(schedule.duty[0]);
  schedule.tick_count = schedule.duty_count = kEntries;
  for (pb_size_t i = 0; i < kEntries; ++i) {
    schedule.tick[i] = i;
    schedule.duty[i] = 0.25F - 0.5F * static_cast<float>(i) / static_cast<float>(kEntries);
  }
  schedule.duty[kEntries - 1] = 0;
  return command;
}

void manual_duty(Session& session, Expectations& expect) {
  const auto page = session.send(sim_robot::get_parameters(0));
  session.send(sim_robot::set_parameter("profile_velocity_m_s", 0.08F));
  session.send(sim_robot::set_parameter("profile_acceleration_m_s2", 0.2F));
  session.run(20);
  expect.that(session.accepted(page), "a page of parameters");
  const auto duty = session.send(sim_robot::set_duty(0.4F));
  session.run(40);
  const auto lease = session.send(sim_robot::renew_lease());
  session.run(150);
  expect.that(session.accepted(duty) && session.accepted(lease), "a manual duty with a lease renewed");
  expect.that(session.has_event(rheonaut_EVENT_KIND_LEASE_LAPSED), "a lease that lapses");
  const auto schedule = session.send(longest_schedule());
  session.run(40);
  session.send(sim_robot::renew_lease());  // it waits longer than one
  session.run(50);
  session.send(sim_robot::renew_lease());  // and lasts longer than one
  session.run(60);
  expect.that(session.accepted(schedule), "a schedule of 64 duties, held for its time");
  expect.that(session.has_event(rheonaut_EVENT_KIND_DUTY_SCHEDULE_ENDED), "the end of the schedule");
  const auto zero = session.send(sim_robot::zero_position());
  session.run(5);
  expect.that(session.accepted(zero), "a position set to zero");
}

void auto_with_disturbance(Session& session, Expectations& expect) {
  const auto entry = session.send(sim_robot::set_auto(0.1F));
  session.run(800);
  const auto disturbance = session.send(sim_robot::inject_disturbance(-0.05F));
  session.run(500);
  expect.that(session.accepted(entry) && session.accepted(disturbance), "auto with a disturbance");
  const auto setpoint = session.send(sim_robot::set_setpoint(0.05F));
  session.run(300);
  const auto controller = session.send(sim_robot::set_controller(robot_fw::biquad_controller()));
  session.run(200);
  const auto restored = session.send(sim_robot::restore_controller());
  session.run(200);
  expect.that(session.accepted(setpoint) && session.accepted(controller) && session.accepted(restored),
              "a new setpoint, a new controller and the old one again");
}

void emergency_and_clear(Session& session, Expectations& expect) {
  const auto stop = session.send(sim_robot::emergency_stop());
  session.run(100);
  expect.that(session.accepted(stop) && session.robot().mode() == rheonaut_MODE_EMERGENCY, "an emergency");
  const auto clear = session.send(sim_robot::clear_emergency(session.robot().emergency_id()));
  session.run(50);
  expect.that(session.accepted(clear) && session.robot().mode() == rheonaut_MODE_MANUAL, "its end");
}

void link_cut_and_backfill(Session& session, Expectations& expect) {
  session.send(sim_robot::set_auto(-0.05F));
  session.run(200);
  session.disconnect();
  session.run(300);
  expect.that(session.robot().link_lost() && session.robot().duty() == 0, "a lost link that stops the motor");
  session.connect(protocol::kMaxSamplesPerFrame);
  session.run(500);
  const std::uint64_t waiting = protocol::kMaxSamplesPerFrame;  // for their batch to be full
  expect.that(session.samples_heard() + waiting >= session.ticks(), "the backfill of every sample");
}

}  // namespace

int record_session(const std::string& path) {
  Session session(path);
  Expectations expect;
  session.run(20);
  session.connect(0);
  session.run(50);
  expect.that(session.robot().link_up(), "hello and welcome");
  manual_duty(session, expect);
  auto_with_disturbance(session, expect);
  emergency_and_clear(session, expect);
  session.perfect_sensor = true;
  session.run(50);
  session.perfect_sensor = false;
  link_cut_and_backfill(session, expect);
  expect.that(session.close(), "a file that took all of it");
  return expect.missing == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
