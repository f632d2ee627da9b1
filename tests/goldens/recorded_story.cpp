// The story in two acts, with the station's restart between them.
#include "tests/goldens/recorded_story.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>

#include <limits>

#include "tests/goldens/database_text.hpp"
#include "tests/goldens/story_act.hpp"
#include "tests/server/recording/schema_dump.hpp"

namespace server {
namespace {

constexpr station::BootId kFirstBoot = 0xfedcba9876543211;  // above what a signed number holds
constexpr station::BootId kSecondBoot = 1;
constexpr station::BootId kFleetBoot = 0x8000000000000000;
constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
template <class Enumerator>
Enumerator unknown(int number) {
  return static_cast<Enumerator>(number);
}

class FirstAct : public Act {
 public:
  using Act::Act;

  void play() {
    station.step_utc(kStoryAfter);
    station.pass(6s);
    prepare();
    connect_r1();
    begin_run();
    swim();
    say_what_cannot_be();
    say_events();
    command_r1();
    stop_and_end();
    run_afterwards();
    lose_samples_of_r2();
    leave_open();
  }

 private:
  void prepare() {
    post("/api/v1/users", {{"name", "ada"}, {"role", "operator"}, {"password", "correct horse"}}, 201);
    post("/api/v1/tokens", {{"name", "lab"}, {"scopes", "read,stop"}, {"days", 30}}, 201);
    post("/api/v1/enrolments", {{"robot_id", "r3"}}, 201);
    post("/api/v1/robots/r3/retire", {{"retired", true}}, 200);
    post("/api/v1/fluids/water/model",
         {{"model_gain_m_s", {0.1, -0.33333334, 0, 10}},
          {"model_time_constant_s", {0.03, 0.5, 3, 1000}},
          {"fit_error", 0.0021},
          {"comment", "at 20 °C"}},
         200);
  }

  void connect_r1() {
    station.is_kept = true;
    r1 = &station.dial(hello_of("r1", kFirstBoot));
    station.watch({"r2"});
    for (const protocol::RobotFrame& frame : {parameters(), controller(), status()}) station.send(*r1, frame);
    station.is_kept = false;
    answer_probe();
    station.is_kept = true;
    post("/api/v1/robots/r1/fluid", {{"fluid", "oil"}}, 200);
    keep("robot_connected.txt", "/api/v1/robots/r1");
    keep("parameters.txt", "/api/v1/robots/r1/parameters");
    keep("controller.txt", "/api/v1/robots/r1/controller");
    keep_text("live_welcome.json", station.welcome() + "\n");
    keep_text("live_problems.jsonl", station.problem_of(R"({"type":"sing"})") + "\n" + station.problem_of("[]") + "\n");
    keep_text("live_dropped.json", station.dropped_message() + "\n");
  }

  // The robot's clock runs behind the station's by half of 8 ms and what it was booted with.
  void answer_probe() {
    const auto probe = [&] {
      for (const auto& heartbeat : r1->heartbeats()) {
        if (heartbeat.station_time_us != 0) return heartbeat.station_time_us;
      }
      return std::uint64_t{0};
    };
    for (int i = 0; i < 20 && probe() == 0; ++i) station.pass(100ms);
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
    frame.body.heartbeat.echo_station_time_us = probe();
    station.pass(8ms);
    frame.body.heartbeat.echo_received_at_robot_us = r1->robot_now_us();
    station.send(*r1, frame);
  }

  void begin_run() {
    post("/api/v1/runs",
         {{"robot_id", "r1"},
          {"name", "Lauf 3 – 漢字 🐟"},
          {"mean_flow_m_s", -0.1},
          {"pump_profile", "pulse"},
          {"tube", "6 mm, \"soft\""},
          {"operator_name", "Zoë"},
          {"notes", "first line\nsecond, with; separators\t\u0001 and 'quotes'"}},
         201);
  }

  // Samples 0 to 54, with a hole of which a part comes later and the rest never.
  void swim() {
    station.send(*r1, samples_of(0, 5), 100ms);
    station.send(*r1, samples_of(5, 5), 50ms);
    post("/api/v1/robots/r1/markers", {{"text", "dye – “red” 🟥"}}, 201);
    const auto to_setpoint = [](float setpoint_m, float disturbance_m) {
      return [=](protocol::Telemetry& batch) {
        batch.mode = rheonaut_MODE_AUTO;
        batch.sub_state = rheonaut_SUB_STATE_NAVIGATING;
        batch.has_setpoint_m = true;
        batch.setpoint_m = setpoint_m;
        batch.disturbance_m = disturbance_m;
        batch.flags = rheonaut_TELEMETRY_FLAG_SATURATED;
      };
    };
    send(samples_of(15, 10), to_setpoint(0.0625F, 0));
    send(samples_of(25, 10), to_setpoint(0.0625F, 0));
    send(samples_of(35, 10), to_setpoint(0.0625F, 0.05F));
    station.is_kept = false;
    station.pass(500ms);
    keep("robot_gaps_missing.txt", "/api/v1/robots/r1/gaps");
    keep("run_samples_waiting.txt", "/api/v1/runs/3/samples?after=0-4&limit=4");
    keep("certificate_open.txt", "/api/v1/runs/3/certificate");
    station.is_kept = true;
    send(samples_of(10, 3), [](auto& batch) { batch.flags = rheonaut_TELEMETRY_FLAG_BACKFILL; });
    send(samples_of(45, 10), [](auto& batch) { batch.oldest_seq = 15; });
    station.send(*r1, samples_of(40, 10));  // once more
  }

  // Samples 55 to 94; those from 85 to 89 never come.
  void say_what_cannot_be() {
    send(samples_of(55, 5), [](auto& batch) { batch.period_us = 0; });
    station.send(*r1, extreme_samples(60));
    send(samples_of(70, 5), [](auto& batch) {
      batch.mode = unknown<protocol::Mode>(17);
      batch.sub_state = unknown<protocol::SubState>(200);
      batch.emergency_cause = unknown<protocol::EmergencyCause>(0x7fffffff);
      batch.flags = 0xffffffff;
    });
    send(samples_of(75, 5), [](auto& batch) {
      batch.has_setpoint_m = true;
      batch.setpoint_m = kInfinity;
      batch.disturbance_m = kNotANumber;
      batch.position_sd_m = -kInfinity;
    });
    send(samples_of(80, 5), [](auto& batch) { batch.period_us = 20'000; });
    send(samples_of(90, 5), [](auto& batch) { batch.first_robot_time_us += 100'003; });
  }

  void say_events() {
    event(0, rheonaut_EVENT_KIND_BOOT, rheonaut_EVENT_CAUSE_RESET, [](auto&) {});
    event(2, unknown<protocol::EventKind>(90), unknown<protocol::EventCause>(91), [](auto& of) {
      of.oldest_event_seq = 2;  // number 1 is lost
      of.mode = unknown<protocol::Mode>(17);
      of.emergency_cause = unknown<protocol::EmergencyCause>(92);
    });
    event(3, rheonaut_EVENT_KIND_SENSOR_FAULT, rheonaut_EVENT_CAUSE_SENSOR, [](auto& of) {
      of.value = kInfinity;
      of.position_m = kNotANumber;
      of.command_id = std::numeric_limits<std::uint64_t>::max();
    });
    event(4, rheonaut_EVENT_KIND_DETECTION, rheonaut_EVENT_CAUSE_IMPEDANCE,
          [](auto& of) { of.value = std::numeric_limits<float>::denorm_min(); });
    event(5, rheonaut_EVENT_KIND_DELIVERY_ENDED, rheonaut_EVENT_CAUSE_TIME, [](auto& of) {
      of.mode = rheonaut_MODE_AUTO;
      of.sub_state = rheonaut_SUB_STATE_HOLDING;
    });
    event(6, rheonaut_EVENT_KIND_LINK_LOST, rheonaut_EVENT_CAUSE_LINK_LOSS, [](auto& of) {
      of.event_robot_time_us = std::uint64_t{1} << 63;  // cannot be
    });
  }

  // Commands in every state that they can end in.
  void command_r1() {
    constexpr auto kAccepted = rheonaut_COMMAND_RESULT_ACCEPTED;
    constexpr auto kRejected = rheonaut_COMMAND_RESULT_REJECTED;
    post("/api/v1/robots/r1/control", {{"action", "take"}, {"lease_ms", 60'000}}, 200);
    command({{"kind", "set_duty"}, {"duty", 0.1}}, kRejected, rheonaut_REJECT_REASON_BUSY);
    station.is_kept = false;
    command({{"kind", "set_duty"}, {"duty", -0.9}}, kRejected, unknown<protocol::RejectReason>(40));
    command({{"kind", "set_duty"}, {"duty", 0.91}}, kAccepted);  // beyond the limits
    command({{"kind", "set_duty"}, {"duty", 0.2}}, rheonaut_COMMAND_RESULT_EXPIRED);
    command({{"kind", "ping"}}, kAccepted);
    command({{"kind", "ping"}}, rheonaut_COMMAND_RESULT_DUPLICATE);
    command({{"kind", "ping"}}, rheonaut_COMMAND_RESULT_OTHER_BOOT);
    station.is_kept = true;
    command({{"kind", "set_mode"}, {"mode", "auto"}, {"setpoint_m", 0.125}}, kAccepted);
    const auto in_auto = [](float setpoint_m) {
      return [=](protocol::Telemetry& batch) {
        batch.mode = rheonaut_MODE_AUTO;
        batch.has_setpoint_m = true;
        batch.setpoint_m = setpoint_m;
      };
    };
    send(samples_now(95, 5), in_auto(0.125F));
    command({{"kind", "set_setpoint"}, {"setpoint_m", 0.2}}, kAccepted);
    command({{"kind", "set_setpoint"}, {"setpoint_m", 0.25}}, kAccepted);
    station.pass(50ms);
    send(samples_now(100, 5), in_auto(0.25F));
    command({{"kind", "set_setpoint"}, {"setpoint_m", 0.1}, {"execute_at_robot_us", r1->robot_now_us() + 500'000}},
            kAccepted);
    station.is_kept = false;
    fail_to_change_a_parameter();
    const auto silence = [](const protocol::Command&) {};
    station.command(*r1, kCommandsOfR1, {{"kind", "ping"}, {"life_ms", 100}},
                    silence);  // what became of it is not known
    station.pass(3s);
  }

  void fail_to_change_a_parameter() {
    const auto differently = [&](const protocol::Command& sent) {
      r1->acknowledge(sent, rheonaut_COMMAND_RESULT_ACCEPTED);
      protocol::RobotFrame page = parameters();
      page.body.parameter_page.command_id = sent.command_id;
      page.body.parameter_page.first_index = 1;
      page.body.parameter_page.parameters_count = 1;
      page.body.parameter_page.parameters[0] = page.body.parameter_page.parameters[1];
      r1->send(page);
    };
    station.command(*r1, kCommandsOfR1, {{"kind", "set_parameter"}, {"name", "duty_slew_per_s"}, {"value", 0.1}},
                    differently);
  }

  // The stop is in force, cleared, and the run ends.
  void stop_and_end() {
    constexpr std::uint64_t kEmergency = std::numeric_limits<std::uint64_t>::max();
    station.is_kept = true;
    const auto stopped = [&](const protocol::Command& sent) {
      r1->acknowledge(sent, rheonaut_COMMAND_RESULT_ACCEPTED, kEmergency);
    };
    station.command(*r1, "/api/v1/robots/r1/emergency-stop", nullptr, stopped);
    send(samples_now(105, 5), [](auto& batch) {
      batch.mode = rheonaut_MODE_EMERGENCY;
      batch.emergency_id = kEmergency;
      batch.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
      std::fill_n(batch.duty, batch.duty_count, 0.0F);
    });
    event(7, rheonaut_EVENT_KIND_EMERGENCY, rheonaut_EVENT_CAUSE_COMMAND, [](auto& of) {
      of.mode = rheonaut_MODE_EMERGENCY;
      of.emergency_id = kEmergency;
      of.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
    });
    keep("robot_stopped.txt", "/api/v1/robots/r1");
    command({{"kind", "clear_emergency"}, {"emergency_id", std::to_string(kEmergency)}},
            rheonaut_COMMAND_RESULT_ACCEPTED);
    station.send(*r1, samples_now(110, 5), 100ms);
    station.is_kept = false;
    announce_and_reboot();
    post("/api/v1/runs/3/end", {{"verdict", "usable – mostly"}}, 200);
    post("/api/v1/runs/3/annotate", {{"notes", "what was said before is kept ✓"}, {"fluid", "oil"}}, 200);
    station.pass(4s);
  }

  // Samples 115 to 119 were made and never sent: the robot says so, and boots. The run goes on in a second span.
  void announce_and_reboot() {
    protocol::RobotFrame again = hello_of("r1", kFirstBoot);
    again.body.hello.next_seq = 120;
    again.body.hello.next_event_seq = 9;
    r1->link.cut();
    station.pass(200ms);
    r1 = &station.dial(again, microseconds{static_cast<std::int64_t>(r1->robot_now_us())});
    r1->link.cut();
    station.pass(200ms);
    protocol::RobotFrame rebooted = hello_of("r1", kSecondBoot);
    rebooted.body.hello.reset_cause = unknown<protocol::ResetCause>(9);
    r1 = &station.dial(rebooted);
    station.send(*r1, samples_of(0, 10), 2s);
  }

  void run_afterwards() {
    post("/api/v1/runs",
         {{"robot_id", "r1"},
          {"name", "afterwards"},
          {"span", {{"boot_id", std::to_string(kFirstBoot)}, {"first_seq", 15}, {"last_seq", 44}}}},
         201);
    post("/api/v1/runs",
         {{"robot_id", "r1"},
          {"name", "discarded"},
          {"span", {{"boot_id", std::to_string(kFirstBoot)}, {"first_seq", 0}, {"last_seq", 9}}}},
         201);
    post("/api/v1/runs/5/discard", {{"reason", "the tube was loose"}}, 200);
    post("/api/v1/runs/4/reference",
         {{"csv", positions_from_outside()},
          {"source", "camera “1”.csv"},
          {"sd_m", 0.0005},
          {"keep_zero", true},
          {"span", 0},
          {"clock", {{"method", "offset"}, {"offset_s", 0.01}, {"sd_s", 0.005}}}},
         201);
  }

  // Twelve positions within the run and one after it.
  static std::string positions_from_outside() {
    std::string csv = "t_s,position_m\n";
    for (const int k : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 3000}) csv += fmt::format("{},{}\n", k * 0.02, k * 0.002);
    return csv;
  }

  // What r2 held no more when it came, what another station had, and what found no room here.
  void lose_samples_of_r2() {
    protocol::RobotFrame hello = hello_of("r2", kFleetBoot);
    hello.body.hello.oldest_seq = 10;
    hello.body.hello.next_seq = 10;
    hello.body.hello.acknowledged_next_seq = 5;
    TestRobot& r2 = station.dial(hello);
    for (std::uint64_t seq = 10; seq < 85; seq += 25) r2.send(samples_of(seq, 25));
    station.pass(2s);
    protocol::RobotFrame later = samples_of(85, 5);
    later.body.telemetry.oldest_seq = 85;
    station.send(r2, later, 3s);
    keep("robots.txt", "/api/v1/robots");
  }

  // The station stops with a run that is open and a stop that no robot has acknowledged.
  void leave_open() {
    post("/api/v1/runs", {{"robot_id", "r1"}, {"name", "open when the station stopped"}}, 201);
    station.send(*r1, samples_of(10, 5), 2s);
    keep("run_open.txt", "/api/v1/runs/6");
    r1->link.cut();
    station.pass(2s);
    post("/api/v1/robots/r1/emergency-stop", nullptr, 202);
    keep("robot_with_pending_stop.txt", "/api/v1/robots/r1");
    keep_text("live_all.jsonl", station.heard_by_all());
    keep_text("live_watcher.jsonl", station.heard_by_watcher());
  }
};

// An hour later, on a database that was restored meanwhile.
class SecondAct : public Act {
 public:
  using Act::Act;

  void play() {
    station.step_utc(kStoryAfter + 1h);
    station.pass(6s);
    protocol::RobotFrame hello = hello_of("r2", kFleetBoot);
    hello.body.hello.oldest_seq = 95;
    hello.body.hello.next_seq = 95;
    TestRobot& r2 = station.dial(hello, 3600s);
    post("/api/v1/runs", {{"robot_id", "r2"}, {"name", "ended without a sample of its last second"}}, 201);
    station.send(r2, samples_of(95, 10), 2s);
    post("/api/v1/runs/7/end", json::object(), 200);
    station.pass(4s);
  }
};

// Between the acts: a restore is noted, and retention removed what r2 had lost at first.
void change_between(const std::filesystem::path& path) {
  SQLite::Database database{path.string(), SQLite::OPEN_READWRITE};
  database.exec("INSERT INTO meta (name, value) VALUES ('restored_at_us', 1795578959000000)");
  database.exec(
      "UPDATE gap SET cause = 'retention' WHERE cause = 'ring_overrun' AND boot_key IN"
      " (SELECT boot_key FROM boot WHERE robot_id = 'r2')");
}

template <class Of>
std::string database_after(const std::filesystem::path& begin, Story& story) {
  Of act{begin, story};
  act.play();
  act.station.finish();
  return database_text(act.station.database());
}

}  // namespace

Story record_story() {
  Story story;
  const TemporaryFolder folder;
  make_database(folder.path() / "version_6.sqlite", "version_6.sql");
  const std::string between = database_after<FirstAct>(folder.path() / "version_6.sqlite", story);
  make_database_of_text(folder.path() / "between.sqlite", between);
  change_between(folder.path() / "between.sqlite");
  story.database = database_after<SecondAct>(folder.path() / "between.sqlite", story);
  return story;
}

}  // namespace server
