// A station with accounts, experiments and a simulated robot, of which rights end; in virtual time.
#pragma once

#include "server/identity/accounts.hpp"
#include "server/storage/experiments/experiment_store.hpp"
#include "tests/server/link/test_robot.hpp"
#include "tests/system/experiment_fixture.hpp"

namespace server {

class EndedRightsTest : public ExperimentTest {
 public:
  using ExperimentTest::control_by, ExperimentTest::experiments;
  using SystemTest::clock, SystemTest::station, SystemTest::wait_for;

  EndedRightsTest() : ExperimentTest{true} {
    const auto end = [this](const runtime::EndedRight& right) { station.end_right(right); };
    accounts.rights().add({"what robots do", identity::Scope::command, [this] { return station.acting(); }, end});
    accounts.rights().add({"experiments", identity::Scope::command, [this] { return experiments->acting(); }, end});
    station.add_sink(sink);
    tasks.spawn("rights", accounts.watch_rights());
    tasks.spawn("control", station.watch_control());
    begin();
    clock.run_for(4s);  // nobody has commanded the robot for so long
  }
  ~EndedRightsTest() override {
    tasks.stop();
    clock.settle();
  }

  // --- whose rights they are; each name is used once ---
  std::string new_user(identity::Role role = identity::Role::operator_) {
    identity::User user;
    user.name = "user" + std::to_string(++names_);
    user.role = role;
    EXPECT_TRUE(wait_for(accounts.add_user(user, admin())));
    return user.name;
  }
  std::string token(const std::string& owner = "", std::int64_t days = 0) {
    identity::TokenRequest request{"token" + std::to_string(++names_), identity::parse_scopes("command,record").value(),
                                   days, owner};
    EXPECT_TRUE(wait_for(accounts.add_token(request, admin())));
    return "token:" + request.name;
  }
  std::string page(const std::string& user) {
    accounts.open_session(user, "127.0.0.1", "a browser");
    const std::string session = "session:" + std::to_string(accounts.sessions().back().number);
    return user.empty() ? session : "user:" + user + "/" + session;
  }
  // The newest token expires in this time.
  microseconds left_of_token() { return microseconds{accounts.tokens().back().expires_at_us - clock.utc_us()}; }
  std::uint64_t session() const { return accounts.sessions().back().number; }
  station::Author by(const std::string& actor) const { return {actor, "127.0.0.1", clock.utc_us()}; }
  station::Author admin() const { return by("token:local"); }
  void change(const std::string& user, const identity::UserChange& wanted, const station::Author& author) {
    EXPECT_TRUE(wait_for(accounts.change_user(user, wanted, author)));
  }

  // --- what acts in their name ---
  double duty() const { return robot->simulated().motor_duty(); }
  void send(const std::string& actor, protocol::Command action, microseconds then = 500ms) {
    const auto record = command_by(actor, action);
    EXPECT_TRUE(record) << record.error().detail;
    clock.run_for(then);
  }
  storage::ExperimentId begin_by(const std::string& actor, const char* step, bool is_unattended = false) {
    const auto begun = try_to_begin(profile({step}, is_unattended ? "unattended = true\n" : ""), actor, is_unattended);
    EXPECT_TRUE(begun) << begun.error().detail;
    return begun->experiment.id;
  }
  // It runs, and the robot moves.
  void start_by(const std::string& actor, const char* step, bool is_unattended = false) {
    come(actor);
    experiment = begin_by(actor, step, is_unattended);
    EXPECT_TRUE(clock.run_until([&] { return duty() != 0; }, 20s));
    clock.run_for(500ms);
    if (is_unattended) leave(actor);
  }
  bool is_at_rest() const { return state().context.mode == rheonaut_MODE_MANUAL && duty() == 0; }
  // What the robot was told in this name so far.
  std::ptrdiff_t told_by(const std::string& actor) const {
    return std::ranges::count(sink.commands, actor, &station::CommandRecord::actor);
  }

  // The rest that robots are owed, by the disk; and one that an earlier start of the station has left.
  std::vector<storage::OwedRest> owed() {
    auto read = [](storage::Database& database) { return storage::owed_rests(database); };
    return wait_for(recording->recorder.on_disk(std::move(read)));
  }
  void owe(station::BootId boot_id) {
    auto write = [boot_id](storage::Database& database) {
      storage::owe_rest(database, {"sim-1", boot_id, "a token was revoked"}, 1);
      return true;
    };
    EXPECT_TRUE(wait_for(recording->recorder.on_disk(std::move(write))));
  }

  identity::Accounts accounts{loop, clock, recording->recorder, recording->removal_clock, folder};
  RecordingSink sink;
  storage::ExperimentId experiment = 0;  // the newest; 0: none

 private:
  int names_ = 0;
};

}  // namespace server
