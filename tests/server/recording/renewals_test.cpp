// What is stored of a duty that is held: the first renewal of its lease, how many followed, and when the last of them
// was asked for. What a crash has made unknown is stored as unknown.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <iostream>

#include "server/storage/upkeep/audit_check.hpp"
#include "tests/server/recording/recorder_fixture.hpp"

namespace server {
namespace {

using station::CommandState;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class RenewalsTest : public RecorderFixture {
 protected:
  station::CommandRecord request(const char* kind) {
    station::CommandRecord made;
    made.id = ++last_id_ * 1'000'003U;
    made.robot_id = robot_.id;
    made.boot_id = robot_.boot_id;
    made.kind = kind;
    made.arguments = made.kind == "set_duty" ? R"({"duty":0.3})" : "{}";
    made.actor = "user:anna/session:4";
    made.peer = "192.168.1.7";
    made.life_from = "stamp";
    made.submitted_at_us = clock_.utc_us();
    recorder_->on_command(made);
    return made;
  }
  void send(station::CommandRecord& made) {
    made.state = CommandState::sent;
    made.sent_at_us = clock_.utc_us();
    made.sent_after_us = made.sent_at_us - made.submitted_at_us;
    recorder_->on_command(made);
  }
  void end(station::CommandRecord& made, CommandState state, const char* reason = "") {
    made.state = state;
    made.reason = reason;
    made.ended_at_us = clock_.utc_us();
    if (was_accepted(state)) {
      made.acknowledged_after_us = made.ended_at_us - made.submitted_at_us;
      made.effect_at_robot_us = static_cast<std::uint64_t>(clock_.steady_us()) + 1;
    }
    recorder_->on_command(made);
  }
  station::CommandRecord order(const char* kind, CommandState state = CommandState::acknowledged) {
    station::CommandRecord made = request(kind);
    send(made);
    clock_.run_for(10ms);
    end(made, state, was_accepted(state) ? "" : "nothing_to_renew");
    return made;
  }
  void hold(int renewals) {
    for (int n = 0; n < renewals; ++n) {
      clock_.run_for(140ms);
      order("renew_lease");
    }
  }
  Rows commands() {
    return rows(
        "SELECT kind, state, reason, further_renewals, last_renewed_at_us - submitted_at_us FROM command"
        " ORDER BY submitted_at_us, command_id");
  }
  std::int64_t entries() { return number("SELECT count(*) FROM audit WHERE action LIKE 'command.%'"); }
  std::vector<std::string> faults() {
    SQLite::Database database = storage::open_for_reading(path_);
    return storage::check_audit(database, {}).faults;
  }

  std::uint64_t last_id_ = 0;
};

TEST_F(RenewalsTest, AnHourOfAHeldDutyIsAFewRows) {
  constexpr int kRenewals = 24'000;  // one in 150 ms, as a page does
  start();
  connect(robot_);
  flush();
  const auto bytes = [this] { return number("PRAGMA page_count") * number("PRAGMA page_size"); };
  wait(recorder_->flush_records());
  const std::int64_t before = bytes();
  order("set_duty");
  hold(kRenewals);
  order("set_duty");
  clock_.run_for(2s);
  wait(recorder_->flush_records());
  const std::int64_t grown = bytes() - before;
  std::cout << fmt::format("an hour of a held duty: {} bytes, {:.1f} for each of {} renewals\n", grown,
                           static_cast<double>(grown) / kRenewals, kRenewals);
  EXPECT_LE(grown, 32'768);
  EXPECT_LE(entries(), 8);
  EXPECT_THAT(rows("SELECT sum(1 + further_renewals) FROM command WHERE kind = 'renew_lease'"),
              ElementsAre(std::to_string(kRenewals)));
  stop();
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(RenewalsTest, TheFirstIsStoredAtOnceAndTheirNumberWhenTheyEnd) {
  start();
  connect(robot_);
  order("set_duty");
  hold(5);
  wait(recorder_->flush_records());
  EXPECT_EQ(commands(), (Rows{"set_duty|acknowledged||0|", "renew_lease|acknowledged|||"})) << "they go on";
  order("set_duty");
  wait(recorder_->flush_records());
  EXPECT_EQ(commands(),
            (Rows{"set_duty|acknowledged||0|", "renew_lease|acknowledged||4|600000", "set_duty|acknowledged||0|"}));
  EXPECT_EQ(rows("SELECT json_extract(detail, '$.further_renewals'), json_type(detail, '$.further_renewals') FROM audit"
                 " WHERE json_extract(detail, '$.kind') = 'renew_lease' AND action = 'command.acknowledged'"),
            (Rows{"|null", "4|integer"}));
  stop();
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(RenewalsTest, SilenceEndsThem) {
  start();
  connect(robot_);
  hold(3);
  clock_.run_for(1500ms);
  hold(2);
  clock_.run_for(1500ms);
  EXPECT_EQ(commands(), (Rows{"renew_lease|acknowledged||2|300000", "renew_lease|acknowledged||1|150000"}));
}

TEST_F(RenewalsTest, OneThatIsRefusedIsARowByItself) {
  start();
  connect(robot_);
  hold(3);
  order("renew_lease", CommandState::rejected);
  order("renew_lease", CommandState::expired);
  hold(2);
  stop();
  EXPECT_EQ(commands(), (Rows{"renew_lease|acknowledged||4|620000", "renew_lease|rejected|nothing_to_renew|0|",
                              "renew_lease|expired|nothing_to_renew|0|"}));
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(RenewalsTest, AnotherActorOrAnotherLeaseBeginsARowOfItsOwn) {
  start();
  connect(robot_);
  hold(2);
  station::CommandRecord other = request("renew_lease");
  other.id += 1;
  other.actor = "token:ci";
  recorder_->on_command(other);
  end(other, CommandState::acknowledged);
  wait(recorder_->flush_records());
  EXPECT_EQ(rows("SELECT actor, further_renewals FROM command ORDER BY submitted_at_us, command_id"),
            (Rows{"user:anna/session:4|", "token:ci|"}));
}

// Two overtake each other: the answer to a renewal comes after the command that ends the hold.
TEST_F(RenewalsTest, OneOnItsWayWhenTheDutyEndsStillCounts) {
  start();
  connect(robot_);
  hold(2);
  station::CommandRecord last = request("renew_lease");
  send(last);
  station::CommandRecord off = request("set_duty");
  end(last, CommandState::acknowledged);
  end(off, CommandState::acknowledged);
  wait(recorder_->flush_records());
  EXPECT_EQ(commands(), (Rows{"renew_lease|acknowledged||2|160000", "set_duty|acknowledged||0|"}));
}

TEST_F(RenewalsTest, AfterACrashTheirNumberIsUnknownAndSaidSo) {
  start();
  connect(robot_);
  hold(5);
  wait(recorder_->flush_records());
  kill();
  start();
  EXPECT_EQ(commands(), Rows{"renew_lease|acknowledged|station_restarted||"});
  const auto listed = wait(history_->commands(robot_.id, {.renewals = storage::RenewalRows::counted})).records;
  ASSERT_EQ(listed.size(), 1u);
  EXPECT_FALSE(listed[0].further_renewals.has_value());
  connect(robot_);
  hold(2);
  stop();
  EXPECT_EQ(commands(), (Rows{"renew_lease|acknowledged|station_restarted||", "renew_lease|acknowledged||1|150000"}));
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(RenewalsTest, WhatIsOnItsWayWhenTheStationStopsIsStoredAsItIs) {
  start();
  connect(robot_);
  hold(2);
  station::CommandRecord last = request("renew_lease");
  send(last);
  stop();
  EXPECT_EQ(commands(), (Rows{"renew_lease|acknowledged||1|150000", "renew_lease|sent||0|"}));
  start();
  EXPECT_EQ(commands(), (Rows{"renew_lease|acknowledged||1|150000", "renew_lease|unknown|station_restarted|0|"}));
}

}  // namespace
}  // namespace server
