// A foreign or damaged file is detected from its bytes and stays unchanged; the message of damage says what to do.
#include "server/storage/database/file_check.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

#include "server/storage/database/schema.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class FileCheckTest : public RecordingTest {
 protected:
  static std::string content(const fs::path& path) {
    std::ostringstream bytes;
    bytes << std::ifstream{path, std::ios::binary}.rdbuf();
    return bytes.str();
  }
  static fs::path beside(const fs::path& path, const char* suffix) { return fs::path{path}.concat(suffix); }

  std::string refusal() {
    try {
      const storage::Database database{path_};
      return "(it was opened)";
    } catch (const std::runtime_error& error) {
      return error.what();
    }
  }

  // What a crash leaves: the files as they are now, without the process that works on them.
  void leave_at(const fs::path& from, const fs::path& to) {
    for (const char* suffix : {"", "-journal", "-wal"}) {
      fs::remove(beside(to, suffix));
      if (fs::exists(beside(from, suffix))) fs::copy_file(beside(from, suffix), beside(to, suffix));
    }
  }

  void overwrite(std::size_t offset, const std::string& bytes) {
    std::fstream file{path_, std::ios::binary | std::ios::in | std::ios::out};
    file.seekp(static_cast<std::streamoff>(offset));
    file << bytes;
  }

  // A station that was killed while it made the schema: all of it is in the log. Returns its identity.
  std::uint64_t leave_begun() {
    constexpr std::uint64_t kStoreId = 4711;
    SQLite::Database made{theirs_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
    made.exec("PRAGMA page_size = 4096; PRAGMA auto_vacuum = INCREMENTAL; PRAGMA journal_mode = WAL");
    made.exec("PRAGMA wal_autocheckpoint = 0; BEGIN");
    for (const char* script : storage::migrations()) made.exec(script);
    made.exec(fmt::format("INSERT INTO meta (name, value) VALUES ('store_id', {}), ('next_row', 1)", kStoreId));
    made.exec(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}; COMMIT", storage::kApplicationId,
                          storage::migrations().size()));
    leave_at(theirs_, path_);
    return kStoreId;
  }

  const fs::path theirs_ = folder_ / "theirs.sqlite";
};

TEST_F(FileCheckTest, AForeignFileWithAHotJournalStaysByteForByte) {
  {
    SQLite::Database theirs{theirs_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
    theirs.exec("PRAGMA cache_size = 5; CREATE TABLE theirs (x)");
    theirs.exec(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 2000)"
        " INSERT INTO theirs SELECT randomblob(100) FROM n");
    theirs.exec("BEGIN; UPDATE theirs SET x = randomblob(100)");  // more than the cache: pages and journal are written
    leave_at(theirs_, path_);
    theirs.exec("ROLLBACK");
  }
  const std::string file = content(path_);
  const std::string journal = content(beside(path_, "-journal"));
  ASSERT_GT(journal.size(), 10'000U);
  EXPECT_THAT(refusal(), HasSubstr("belongs to another program"));
  EXPECT_EQ(content(path_), file);
  EXPECT_EQ(content(beside(path_, "-journal")), journal);

  // SQLite would change it by opening it.
  SQLite::Database{path_.string(), SQLite::OPEN_READWRITE}.execAndGet("SELECT count(*) FROM theirs");
  EXPECT_NE(content(path_), file);
}

TEST_F(FileCheckTest, AForeignFileWhoseTablesAreInItsLogStaysByteForByte) {
  {
    SQLite::Database theirs{theirs_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
    theirs.exec("PRAGMA journal_mode = WAL; CREATE TABLE theirs (x); INSERT INTO theirs VALUES (1)");
    leave_at(theirs_, path_);
  }
  const std::string file = content(path_);
  const std::string log = content(beside(path_, "-wal"));
  ASSERT_GT(log.size(), 4096U);
  EXPECT_FALSE(storage::file_problem(path_).has_value()) << "it looks blank: SQLite has to tell";
  EXPECT_THAT(refusal(), HasSubstr("belongs to another program"));
  EXPECT_EQ(content(path_), file);
  EXPECT_EQ(content(beside(path_, "-wal")), log);
}

// Our own beginning has two steps on one page; the power may fail in the second, too. The same with anybody's mark in
// the page as it was is somebody else's file.
TEST_F(FileCheckTest, ATornFirstPageWithItsJournalIsOursOnlyIfItWasBlank) {
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xFFU);
    return bytes;
  };
  for (const bool is_theirs : {true, false}) {
    fs::remove(theirs_);
    {
      SQLite::Database made{theirs_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
      made.exec("PRAGMA journal_mode = WAL; PRAGMA journal_mode = DELETE");
      if (is_theirs) made.exec("PRAGMA application_id = 7");
    }
    const std::string page = content(theirs_);
    ASSERT_EQ(page.size(), 4096U);
    std::uint32_t sum = 7;  // the nonce
    for (std::size_t i = page.size() - 200; i > 0 && i < page.size(); i -= 200)
      sum += static_cast<unsigned char>(page[i]);
    std::string journal = "\xd9\xd5\x05\xf9\x20\xa1\x63\xd7";
    for (const std::uint32_t field : {1U, 7U, 1U, 512U, 4096U}) journal += number(field);
    journal.resize(512);
    journal += number(1) + page + number(sum);
    std::ofstream{path_, std::ios::binary} << std::string(4096, 'x');
    std::ofstream{beside(path_, "-journal"), std::ios::binary} << journal;
    EXPECT_THAT(refusal(), HasSubstr(is_theirs ? "not an SQLite database" : "(it was opened)"));
    if (is_theirs) EXPECT_EQ(content(beside(path_, "-journal")), journal) << "and nothing was changed";
  }
}

TEST_F(FileCheckTest, AnEmptyFileWithSomebodysJournalIsRefused) {
  std::ofstream{path_}.flush();
  std::ofstream{beside(path_, "-journal"), std::ios::binary}
      << std::string{"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7\xff\xff\xff\xff\0\0\0\1\0\0\0\2\0\0\2\0\0\0\x10\0", 28};
  EXPECT_THAT(refusal(), HasSubstr("a journal beside it is not ours"));
}

TEST_F(FileCheckTest, OurOwnFileWhoseTablesAreInItsLogIsOpened) {
  const std::uint64_t store_id = leave_begun();
  ASSERT_GT(content(beside(path_, "-wal")).size(), 4096U);
  EXPECT_EQ(storage::Database{path_}.store_id(), store_id);
}

TEST_F(FileCheckTest, AFirstPageThatIsHalfWrittenIsReadFromTheLog) {
  const std::uint64_t store_id = leave_begun();
  overwrite(0, std::string(512, '\x5a'));
  EXPECT_EQ(storage::Database{path_}.store_id(), store_id);

  overwrite(0, std::string(512, '\x5a'));
  fs::remove(beside(path_, "-wal"));
  EXPECT_THAT(refusal(), HasSubstr("not an SQLite database"));
}

TEST_F(FileCheckTest, AFileThatWasJustBegunIsBegunAgain) {
  std::ofstream{path_, std::ios::binary} << std::string(4096, '\x5a');
  EXPECT_THAT(refusal(), HasSubstr("not an SQLite database"));
  std::ofstream{beside(path_, "-journal"), std::ios::binary}
      << std::string{"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7\0\0\0\0\0\0\0\1\0\0\0\0\0\0\2\0\0\0\x10\0", 28}
      << std::string(512 - 28, '\0');
  EXPECT_NE(storage::Database{path_}.store_id(), 0U);
}

TEST_F(FileCheckTest, ATruncatedFileIsRefused) {
  {
    const storage::Database database{path_};
  }
  fs::resize_file(path_, fs::file_size(path_) - 4096);
  const std::string file = content(path_);
  EXPECT_THAT(refusal(), HasSubstr("it is truncated"));
  EXPECT_EQ(content(path_), file);
  fs::resize_file(path_, 50);
  EXPECT_THAT(refusal(), HasSubstr("it is truncated: 50 bytes are there"));
}

TEST_F(FileCheckTest, AHeaderWithoutAPageSizeIsDamaged) {
  {
    const storage::Database database{path_};
  }
  overwrite(16, std::string{"\x0f\xff", 2});
  EXPECT_THAT(refusal(), HasSubstr("its header is damaged; stop the station, run rheonaut verify, restore a backup"));
}

TEST_F(FileCheckTest, FindsADamagedPageAndARowWithoutItsOther) {
  {
    storage::Database database{path_};
    EXPECT_EQ(storage::find_damage(database.handle()), "");
    database.handle().exec("PRAGMA foreign_keys = OFF; INSERT INTO gap VALUES (77, 0, 1, 'reboot', 0)");
    EXPECT_EQ(storage::find_damage(database.handle()), "a row of gap refers to a row of boot that is not there");
  }
  const std::int64_t page = number("SELECT rootpage FROM sqlite_master WHERE name = 'event'");
  overwrite(static_cast<std::size_t>((page - 1) * 4096), std::string(100, '\xff'));
  storage::Database database{path_};
  EXPECT_NE(storage::find_damage(database.handle()), "");
}

TEST_F(FileCheckTest, DamageAtRunTimeSaysWhatToDoAndDoesNotAskForRoom) {
  {
    const storage::Database database{path_};
  }
  const std::int64_t page = number("SELECT rootpage FROM sqlite_master WHERE name = 'sample'");
  overwrite(static_cast<std::size_t>((page - 1) * 4096), std::string(100, '\xff'));
  start();
  TestRobot robot;
  connect(robot);
  make(robot, 200);
  clock_.run_for(3s);
  EXPECT_TRUE(recorder_->failing());
  EXPECT_THAT(recorder_->problem(), HasSubstr("the file is damaged"));
  EXPECT_THAT(recorder_->problem(), HasSubstr("stop the station, run rheonaut verify, restore a backup"));
  EXPECT_THAT(recorder_->problem(), ::testing::Not(HasSubstr("Make room")));
  EXPECT_EQ(durable_next_seq_, 0U);
}

TEST_F(FileCheckTest, EachCauseHasItsOwnRemedy) {
  const struct {
    int code;
    const char* remedy;
  } cases[] = {{SQLITE_FULL, "Make room on the disk"},
               {SQLITE_BUSY, "End the program that holds the file"},
               {SQLITE_READONLY, "Let the station's user write the file"},
               {SQLITE_CANTOPEN, "Let the station's user write the file"},
               {SQLITE_NOMEM, "dmesg"}};
  for (const auto& [code, remedy] : cases) {
    const SQLite::Exception error{"a text of SQLite", code};
    EXPECT_FALSE(storage::means_damage(error));
    const std::string problem = storage::write_problem(error);
    EXPECT_THAT(problem, HasSubstr(remedy));
    EXPECT_EQ(problem.find("room") != std::string::npos, code == SQLITE_FULL) << problem;
  }
}

TEST_F(FileCheckTest, AFileThatIsNotThereIsTheCauseThoughAnotherProgramHoldsItToo) {
  start();
  TestRobot robot;
  connect(robot);
  SQLite::Database other{path_.string(), SQLite::OPEN_READWRITE};
  other.exec("BEGIN IMMEDIATE");
  std::filesystem::rename(path_, std::filesystem::path{path_}.concat(".elsewhere"));
  make(robot, 200);
  clock_.run_for(3s);
  EXPECT_THAT(recorder_->problem(), HasSubstr("station.sqlite was removed, renamed or replaced"));
  EXPECT_EQ(durable_next_seq_, 0U);
}

}  // namespace
}  // namespace server
