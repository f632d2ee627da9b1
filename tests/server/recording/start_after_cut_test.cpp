// At a start robots may discard what the database has: so that has to be durable by then.
#include <gmock/gmock.h>
#include <stdlib.h>

#include <filesystem>

#include "server/storage/database/database.hpp"
#include "tests/server/recording/forgetful_vfs.hpp"

namespace server {
namespace {

class StartAfterCutTest : public ::testing::Test {
 protected:
  StartAfterCutTest() {
    std::string folder = (std::filesystem::temp_directory_path() / "rheonaut-test-XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + folder};
    folder_ = folder;
    vfs_.begin(survival_, 0);
    storage::Database{path()};
  }
  ~StartAfterCutTest() override { std::filesystem::remove_all(folder_); }

  std::string path() const { return (folder_ / "station.sqlite").string(); }

  // A station begins, finds robots, enrols more until it fails at a call, and is closed. Returns how many it was told
  // or has told somebody of; -1 when it could not begin.
  int enrol_until(std::uint64_t last_call) {
    vfs_.begin(survival_, last_call);
    int known = -1;
    try {
      storage::Database database{path()};
      known = database.handle().execAndGet("SELECT count(*) FROM robot").getInt();
      while (!vfs_.has_failed()) {
        database.handle().exec("INSERT INTO robot (robot_id, enrolled_at_us) VALUES (hex(randomblob(8)), 0)");
        ++known;
      }
    } catch (const SQLite::Exception&) {
    } catch (const std::runtime_error&) {  // the station refuses to begin without power
    }
    return known;
  }

  int robots() {
    vfs_.begin(survival_, 0);
    return storage::Database{path()}.handle().execAndGet("SELECT count(*) FROM robot").getInt();
  }

  std::mt19937 random_{7};
  Survival survival_ = Survival::nothing;
  ForgetfulVfs vfs_;
  std::filesystem::path folder_;
};

TEST_F(StartAfterCutTest, WhatAKillHasLeftInTheLogIsDurableOnceItWasRead) {
  for (std::uint64_t calls = 1; calls < 40; ++calls) {
    const int known = enrol_until(calls);  // killed: what was written is there, and not all of it was synced
    int found = 0;
    {
      vfs_.begin(survival_, 0);
      storage::Database database{path()};
      found = database.handle().execAndGet("SELECT count(*) FROM robot").getInt();
      vfs_.begin(survival_, 1);  // the power fails before anything else is synced
    }
    vfs_.lose_power(random_);
    EXPECT_GE(found, known) << calls << " calls";
    EXPECT_GE(robots(), found) << calls << " calls";
  }
}

TEST_F(StartAfterCutTest, NoCommitIsLostOverManyCutsAndKills) {
  for (const Survival survival : {Survival::nothing, Survival::sectors, Survival::torn}) {
    survival_ = survival;
    int known = 0;
    for (int cut = 0; cut < 150; ++cut) {
      known = std::max(known, enrol_until(1 + random_() % 30));
      if (random_() % 3 > 0) vfs_.lose_power(random_);
      if (random_() % 4 > 0) continue;
      const int found = robots();
      ASSERT_GE(found, known) << text(survival) << ", cut " << cut;
    }
  }
}

// A foreign reader keeps the log from being emptied, and no disk space is no reason not to begin.
TEST_F(StartAfterCutTest, BeginsBesideAReaderAndWithoutRoom) {
  enrol_until(60);
  vfs_.begin(survival_, 0);
  {
    SQLite::Database reader{path(), SQLite::OPEN_READWRITE};
    reader.exec("BEGIN");
    EXPECT_GT(reader.execAndGet("SELECT count(*) FROM robot").getInt(), 0);
    storage::Database{path()};
  }
  enrol_until(60);
  vfs_.begin(survival_, 0);
  vfs_.refuse_writes(1000);
  EXPECT_NO_THROW(storage::Database{path()});
}

}  // namespace
}  // namespace server
