// Whatever somebody does to the audit with all the time in the world and any SQL is found, and at the right entry: by
// the chain alone, or, where a chain is cut or written anew as a whole, by one hash that was kept elsewhere.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <random>
#include <regex>

#include "server/storage/database/statement.hpp"
#include "server/storage/upkeep/audit_check.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::array<const char*, 10> kColumns{"at_us",   "actor",  "peer", "robot_id",     "action",
                                               "subject", "detail", "salt", "content_hash", "hash"};
constexpr const char* kShownColumns = "at_us, actor, peer, robot_id, action, subject, detail, salt, content_hash, hash";

class AuditTamperingTest : public RecordingTest {
 protected:
  // 40 entries and more: commands in three states, control, accounts.
  void SetUp() override {
    start();
    for (int n = 1; n <= 10; ++n) {
      station::AuditNote taken;
      taken.by = {"user:anna/session:4", "192.168.1.7", clock_.utc_us()};
      taken.robot_id = n % 2 == 0 ? "nemo" : "";
      taken.action = n % 2 == 0 ? "control.taken" : "account.signed_in";
      recorder_->on_audit(taken);
      station::CommandRecord command;
      command.id = static_cast<station::CommandId>(n) * 1'000'003U;
      command.robot_id = "nemo";
      command.kind = "set_duty";
      command.arguments = fmt::format(R"({{"duty":0.{}}})", n);
      command.actor = "token:ana";
      command.submitted_at_us = clock_.utc_us();
      for (const station::CommandState state :
           {station::CommandState::queued, station::CommandState::sent, station::CommandState::verified}) {
        command.state = state;
        recorder_->on_command(command);
        ASSERT_TRUE(wait(recorder_->flush_records()));
        clock_.run_for(100ms);
      }
    }
    stop();
    const storage::AuditFindings good = findings();
    ASSERT_THAT(good.faults, IsEmpty());
    head_ = good.head;
    ASSERT_GE(head_.entry, 40);
    whole_ = folder_ / "whole.sqlite";
    std::filesystem::copy_file(path_, whole_);
  }

  // A fresh copy, without the triggers.
  SQLite::Database opened() {
    std::filesystem::copy_file(whole_, path_, std::filesystem::copy_options::overwrite_existing);
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE, 5000};
    database.exec("PRAGMA journal_mode = DELETE; PRAGMA ignore_check_constraints = ON");
    database.exec("DROP TRIGGER audit_in_order; DROP TRIGGER audit_unchanged; DROP TRIGGER audit_kept");
    return database;
  }
  storage::AuditFindings after(const std::string& sql, const std::optional<storage::AuditHead>& expected = {}) {
    {
      SQLite::Database database = opened();
      database.exec(sql);
    }
    return findings(expected);
  }
  storage::AuditFindings findings(const std::optional<storage::AuditHead>& expected = {}) {
    SQLite::Database database = storage::open_for_reading(path_);
    return check_audit(database, expected);
  }
  // The entry that the first fault names; 0: there is none.
  static std::int64_t first_bad(const storage::AuditFindings& found) {
    if (found.faults.empty()) return 0;
    std::smatch match;
    const std::string& fault = found.faults.front();
    return std::regex_search(fault, match, std::regex{"^audit: entry ([0-9]+) "}) ? std::stoll(match[1].str()) : -1;
  }
  std::int64_t some_entry(std::int64_t last) { return std::uniform_int_distribution<std::int64_t>{1, last}(random_); }
  static std::string shift(std::int64_t above, int by) {
    return fmt::format(
        "UPDATE audit SET entry = -entry WHERE entry > {};"
        "UPDATE audit SET entry = -entry + ({}) WHERE entry < 0;",
        above, by);
  }

  storage::AuditHead head_;
  std::filesystem::path whole_;
  std::mt19937 random_{2026};
};

TEST_F(AuditTamperingTest, AChangeOfAnyColumnOfAnyEntryIsFoundThere) {
  for (const std::string column : kColumns) {
    const bool is_blob = column == "salt" || column == "content_hash" || column == "hash";
    for (std::int64_t entry = 1; entry <= head_.entry; entry += column == "at_us" ? 3 : 10) {
      std::string value = fmt::format("{} || ' '", column);
      if (column == "at_us") value = "at_us + 1";
      if (is_blob) {  // random: its first byte may be any
        value = fmt::format("CAST(iif(substr({0}, 1, 1) = x'00', x'01', x'00') || substr({0}, 2) AS BLOB)", column);
      }
      const storage::AuditFindings found =
          after(fmt::format("UPDATE audit SET {} = {} WHERE entry = {}", column, value, entry));
      EXPECT_EQ(first_bad(found), entry) << column;
      EXPECT_EQ(found.head.entry, entry - 1);
    }
  }
}

TEST_F(AuditTamperingTest, AValueOfAnotherTypeIsAChange) {
  EXPECT_EQ(first_bad(after("UPDATE audit SET actor = CAST(actor AS BLOB) WHERE entry = 9")), 9);
  EXPECT_EQ(first_bad(after("UPDATE audit SET salt = CAST('0123456789abcdef' AS TEXT) WHERE entry = 9")), 9);
  EXPECT_EQ(first_bad(after("UPDATE audit SET at_us = at_us + 0.5 WHERE entry = 9")), 9);
}

TEST_F(AuditTamperingTest, AnEntryThatIsRemovedMovedExchangedOrInsertedIsFound) {
  for (int trial = 0; trial < 12; ++trial) {
    const std::int64_t entry = some_entry(head_.entry - 2);
    SCOPED_TRACE(entry);
    EXPECT_EQ(first_bad(after(fmt::format("DELETE FROM audit WHERE entry = {}", entry))), entry);
    EXPECT_EQ(first_bad(after(fmt::format("DELETE FROM audit WHERE entry = {};", entry) + shift(entry, -1))), entry);
    EXPECT_EQ(first_bad(after(fmt::format("UPDATE audit SET entry = 1000 WHERE entry = {}", entry))), entry);
    EXPECT_EQ(first_bad(after(fmt::format("UPDATE audit SET entry = -1 WHERE entry = {}", entry))), -1);
    EXPECT_EQ(
        first_bad(after(shift(entry, 1) + fmt::format("INSERT INTO audit SELECT {}, {} FROM audit WHERE entry = {}",
                                                      entry + 1, kShownColumns, entry))),
        entry + 1);
    const std::int64_t other = entry + 1 + some_entry(head_.entry - entry - 1);
    EXPECT_EQ(first_bad(after(fmt::format("UPDATE audit SET entry = 0 WHERE entry = {0};"
                                          "UPDATE audit SET entry = {0} WHERE entry = {1};"
                                          "UPDATE audit SET entry = {1} WHERE entry = 0",
                                          entry, other))),
              entry);
  }
}

// Who knows the format changes an entry and makes its hashes good again: then the next one does not follow.
TEST_F(AuditTamperingTest, AnEntryWhoseHashesWereMadeGoodAgainBreaksTheNextOne) {
  const auto rewrite = [this](std::int64_t from, std::int64_t to) {
    SQLite::Database database = opened();
    storage::AuditHash before{};
    for (std::int64_t entry = 1; entry <= head_.entry; ++entry) {
      SQLite::Statement row{database, fmt::format("SELECT {} FROM audit WHERE entry = ?", storage::kAuditColumns)};
      storage::bind_all(row, entry);
      row.executeStep();
      storage::AuditEntry read = *storage::audit_entry_from(row);
      row.reset();
      if (entry >= from && entry <= to) {
        if (entry == from) read.note.by.actor = "somebody else";
        read.content_hash = storage::content_hash_of(read.note, read.salt);
        read.hash = storage::link_hash_of(before, entry, read.content_hash);
        SQLite::Statement update{database, "UPDATE audit SET actor = ?, content_hash = ?, hash = ? WHERE entry = ?"};
        update.bind(1, read.note.by.actor);
        update.bind(2, read.content_hash.data(), static_cast<int>(read.content_hash.size()));
        update.bind(3, read.hash.data(), static_cast<int>(read.hash.size()));
        update.bind(4, entry);
        update.exec();
      }
      before = read.hash;
    }
  };
  for (int trial = 0; trial < 8; ++trial) {
    const std::int64_t entry = some_entry(head_.entry - 1);
    rewrite(entry, entry);
    EXPECT_EQ(first_bad(findings()), entry + 1);
  }
  // The whole rest of the chain: only who kept a hash finds it. The account's entry has no row that contradicts.
  const std::int64_t signed_in = 2;
  ASSERT_EQ(number("SELECT action = 'account.signed_in' FROM audit WHERE entry = 2"), 1);
  rewrite(signed_in, head_.entry);
  EXPECT_THAT(findings().faults, IsEmpty());
  EXPECT_THAT(findings(head_).faults, ElementsAre(HasSubstr("the chain was written anew")));
  EXPECT_EQ(first_bad(findings(head_)), head_.entry);
}

TEST_F(AuditTamperingTest, ATailThatWasCutOffIsFoundByAKeptHashAndByTheCommands) {
  for (const std::int64_t kept : {head_.entry - 1, head_.entry / 2, std::int64_t{1}, std::int64_t{0}}) {
    const storage::AuditFindings found = after(fmt::format("DELETE FROM audit WHERE entry > {}", kept), head_);
    ASSERT_FALSE(found.faults.empty());
    EXPECT_THAT(found.faults.front(), HasSubstr(fmt::format("ends with entry {}", kept)));
  }
  EXPECT_THAT(after(fmt::format("DELETE FROM audit WHERE entry > {}", head_.entry - 2)).faults,
              ElementsAre(HasSubstr("names entry")));
}

TEST_F(AuditTamperingTest, ACommandThatSaysSomethingElseThanItsEntryIsFound) {
  EXPECT_THAT(after("UPDATE command SET actor = 'x' WHERE command_id = 1000003").faults,
              ElementsAre(HasSubstr("command 1000003 does not say what entry")));
  EXPECT_THAT(after("UPDATE command SET state = 'rejected' WHERE command_id = 1000003").faults,
              ElementsAre(HasSubstr("command 1000003")));
  EXPECT_THAT(after("UPDATE command SET verified_after_us = 5 WHERE command_id = 1000003").faults,
              ElementsAre(HasSubstr("command 1000003")));
  const storage::AuditFindings removed = after("DELETE FROM command WHERE command_id = 1000003");
  EXPECT_EQ(removed.faults.size(), 3u);  // one for each of its entries
  EXPECT_THAT(removed.faults.front(), HasSubstr("tells of command 1000003, which is not there"));
  EXPECT_THAT(after("UPDATE command SET audit_entry = NULL WHERE command_id = 1000003").faults,
              ::testing::Contains(HasSubstr("names entry 0")));
  EXPECT_THAT(after("INSERT INTO command SELECT 5, robot_id, boot_id, kind, arguments, actor, state, reason,"
                    " submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us, emergency_id, sent_after_us,"
                    " acknowledged_after_us, verified_after_us, life_from, peer, NULL, NULL, NULL FROM command LIMIT 1")
                  .faults,
              ElementsAre(HasSubstr("1 commands have no entry in the audit")));
}

TEST_F(AuditTamperingTest, AnExpectedEntryThatIsThereIsGood) {
  EXPECT_THAT(findings(head_).faults, IsEmpty());
  storage::AuditHead early{3, {}};
  EXPECT_THAT(findings(early).faults, ElementsAre(HasSubstr("entry 3 has the hash")));
}

// A stop that was asked for again, and what was refused, are of the audit and no state of a command.
TEST_F(AuditTamperingTest, WhatIsNoStateOfACommandIsNoTampering) {
  start();
  for (int n = 0; n < 30; ++n) {
    station::AuditNote again;
    again.by = {"token:ana", "", clock_.utc_us()};
    again.robot_id = "nemo";
    again.action = n % 3 == 0 ? "command.refused" : "command.stop_again";
    again.subject = n % 3 == 0 ? "nemo" : "1000003";
    recorder_->on_audit(again);
  }
  ASSERT_TRUE(wait(recorder_->flush_records()));
  stop();
  EXPECT_THAT(findings().faults, IsEmpty());
}

// However many faults of one kind there are, each kind is named, and everything is compared.
TEST_F(AuditTamperingTest, ManyFaultsOfOneKindHideNoneOfAnother) {
  start();
  for (int n = 1; n <= 60; ++n) {
    station::CommandRecord command;
    command.id = static_cast<station::CommandId>(n) * 7'000'003U;
    command.robot_id = "nemo";
    command.kind = "set_duty";
    command.arguments = R"({"duty":0.1})";
    command.actor = "token:ana";
    command.submitted_at_us = clock_.utc_us();
    for (const station::CommandState state : {station::CommandState::sent, station::CommandState::verified}) {
      command.state = state;
      recorder_->on_command(command);
      ASSERT_TRUE(wait(recorder_->flush_records()));
    }
  }
  stop();
  {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE, 5000};
    database.exec(
        "UPDATE command SET audit_entry = audit_entry - 1 WHERE command_id >= 7000003 AND command_id < 300000000");
    database.exec("UPDATE command SET actor = 'token:eve' WHERE command_id = 1000003");
  }
  const std::vector<std::string> faults = findings().faults;
  EXPECT_THAT(faults, testing::Contains(HasSubstr("command 1000003 does not say what entry")));
  EXPECT_THAT(faults,
              testing::Contains(testing::ContainsRegex("and [0-9]+ more entries that their commands do not name")));
  EXPECT_THAT(faults, testing::Contains(testing::ContainsRegex("and [0-9]+ more commands that do not say")));
  EXPECT_EQ(findings().commands, 70U);
}

}  // namespace
}  // namespace server
