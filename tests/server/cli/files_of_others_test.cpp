// Tools on stores and files of another user: each says whose they are and what to type.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "server/storage/database/database.hpp"
#include "server/tls/tls_certificate.hpp"
#include "tests/server/another_user.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// Everything is root's: `lab` is closed, and so is each file of the open folder.
class FilesOfOthers : public ToolTest {
 protected:
  FilesOfOthers() {
    fs::permissions(folder_, fs::perms{0755});
    fs::create_directory(folder_ / "lab");
    {
      storage::Database{folder_ / "lab" / "station.sqlite"};
    }
    fs::copy_file(folder_ / "lab" / "station.sqlite", folder_ / "backup.sqlite");
    for (const char* name : {"run.eln", "run.csv", "profile.toml", "plant.json", "station.toml", "key.pem"}) {
      save(name, "secret");
      fs::permissions(folder_ / name, fs::perms{0600});
    }
    fs::permissions(folder_ / "backup.sqlite", fs::perms{0600});
    fs::permissions(folder_ / "lab", fs::perms{0700});
  }
  void SetUp() override {
    if (!may_be_another_user()) GTEST_SKIP() << "only root can be somebody else";
  }
  Answer ask_as_nobody(const std::string& command) {
    const AnotherUser nobody;
    return ask(command);
  }
  std::string owner(const char* name, const char* mode) {
    return "'" + (folder_ / name).string() + "' belongs to root (mode " + mode +
           "), and this program runs as nobody; run it as root";
  }
};

TEST_F(FilesOfOthers, AStoreIsRefusedWithItsOwner) {
  for (const char* command :
       {"verify --data @lab", "verify --audit --data @lab", "verify --file @lab/station.sqlite",
        "export --run 1 --format csv --to @out --data @lab", "reference show --run 1 --data @lab",
        "reference remove --run 1 --reason wrong --data @lab", "backup --data @lab --to @copy.sqlite",
        "user list --data @lab", "token list --data @lab", "job list --data @lab", "doctor --data @lab"}) {
    const Answer answer = ask_as_nobody(command);
    EXPECT_NE(answer.exit_code, 0) << command;
    EXPECT_THAT(answer.error + answer.text, AllOf(HasSubstr(owner("lab", "0700")), Not(HasSubstr("SQLite 14"))))
        << command;
  }
}

TEST_F(FilesOfOthers, AFileIsRefusedWithItsOwner) {
  const struct {
    const char* command;
    const char* file;
  } kCases[] = {
      {"verify --file @backup.sqlite", "backup.sqlite"},
      {"restore --from @backup.sqlite --data @own/restored", "backup.sqlite"},
      {"reproduce @run.eln", "run.eln"},
      {"profile @profile.toml", "profile.toml"},
      {"bode --plant @plant.json", "plant.json"},
      {"identify --csv @run.csv", "run.csv"},
      {"check-config --config @station.toml", "station.toml"},
  };
  fs::create_directory(folder_ / "own");
  ASSERT_EQ(::chown((folder_ / "own").c_str(), kNobody, kNobody), 0);
  for (const auto& [command, file] : kCases) {
    const Answer answer = ask_as_nobody(command);
    EXPECT_NE(answer.exit_code, 0) << command;
    EXPECT_THAT(answer.error, HasSubstr(owner(file, "0600") + ", or type: sudo chown -R nobody '")) << command;
  }
}

// The database itself may be read, which says nothing of what its head file has to say.
TEST_F(FilesOfOthers, AHeadFileIsNamedWithItsOwner) {
  fs::create_directory(folder_ / "open");
  fs::permissions(folder_ / "open", fs::perms{0755});
  fs::copy_file(folder_ / "lab" / "station.sqlite", folder_ / "open" / "station.sqlite");
  save("open/station.head.json", "{}");
  fs::permissions(folder_ / "open" / "station.sqlite", fs::perms{0644});
  fs::permissions(folder_ / "open" / "station.head.json", fs::perms{0600});
  const Answer answer = ask_as_nobody("verify --data @open");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.text, HasSubstr(owner("open/station.head.json", "0600") + ", or type: sudo chown -R nobody '"));
  EXPECT_THAT(answer.text, HasSubstr("whether station.sqlite has lost commits cannot be told"));
}

TEST_F(FilesOfOthers, ABackupIsNotBegunInAFolderOfAnotherUser) {
  fs::create_directory(folder_ / "own");
  {
    storage::Database{folder_ / "own" / "station.sqlite"};
  }
  fs::create_directory(folder_ / "disk");
  fs::permissions(folder_ / "disk", fs::perms{0755});  // whatever mask an earlier command has set
  for (const auto& entry : fs::recursive_directory_iterator{folder_ / "own"})
    ASSERT_EQ(::chown(entry.path().c_str(), kNobody, kNobody), 0);
  ASSERT_EQ(::chown((folder_ / "own").c_str(), kNobody, kNobody), 0);
  const Answer answer = ask_as_nobody("backup --data @own --to @disk/copy.sqlite");
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.error, AllOf(HasSubstr("no backup can be written into"), HasSubstr(owner("disk", "0755"))));
  EXPECT_TRUE(fs::is_empty(folder_ / "disk"));
}

TEST_F(FilesOfOthers, ATlsKeyOfAnotherUserIsRefusedWithItsOwner) {
  const AnotherUser nobody;
  std::string said;
  try {
    tls::load_key(folder_ / "key.pem");
  } catch (const std::runtime_error& error) {
    said = error.what();
  }
  EXPECT_THAT(said, HasSubstr("cannot read '" + (folder_ / "key.pem").string() + "': " + owner("key.pem", "0600")));
}

}  // namespace
}  // namespace server::cli
