// Whose the data folder and its token are, and what is written beside the database.
#include "server/runtime/private_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "server/config/data_folder.hpp"
#include "server/runtime/tasks.hpp"
#include "tests/server/another_user.hpp"
#include "tests/server/captured_log.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;

class PrivateFile : public testing::Test {
 protected:
  ~PrivateFile() override { fs::remove_all(folder); }
  static fs::path made() {
    std::string name = (fs::temp_directory_path() / "rheonaut-private-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error{"no temporary folder"};
    return name;
  }
  fs::path file(const std::string& content, mode_t mode = 0600) const {
    const fs::path path = folder / "rheonaut.token";
    std::ofstream{path} << content;
    EXPECT_EQ(::chmod(path.c_str(), mode), 0);
    return path;
  }
  template <class Call>
  static std::string refusal(Call call) {
    try {
      call();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder = made();
};

TEST_F(PrivateFile, IsReadOrMissing) {
  EXPECT_EQ(runtime::read_private(folder / "rheonaut.token"), std::nullopt);
  EXPECT_EQ(runtime::read_private(file("secret\n")), "secret\n");
}

TEST_F(PrivateFile, ThatIsTooLongIsRefusedWithItsSize) {
  const fs::path token = file("secret");
  fs::resize_file(token, 65'536);
  EXPECT_EQ(runtime::read_private(token)->size(), 65'536U);
  fs::resize_file(token, 65'537);
  EXPECT_EQ(refusal([&] { runtime::read_private(token); }),
            "'" + token.string() + "' has more than 65536 bytes: 65537");
}

TEST_F(PrivateFile, ThatAllMayWriteIsRefusedWithTheLineToType) {
  const fs::path token = file("secret", 0666);
  const std::string said = refusal([&] { runtime::read_private(token); });
  EXPECT_NE(said.find("chmod o-w '" + token.string() + "'"), std::string::npos) << said;
}

TEST_F(PrivateFile, ThatItsGroupMayWriteIsRefusedWithTheLineToType) {
  const fs::path token = file("secret", 0660);
  const std::string said = refusal([&] { runtime::read_private(token); });
  EXPECT_NE(said.find("rm '" + token.string() + "'"), std::string::npos) << said;
}

TEST_F(PrivateFile, ThatOthersMayReadIsProtectedWithAWarning) {
  const fs::path token = file("secret", 0644);
  const CapturedLog log;
  EXPECT_EQ(runtime::read_private(token), "secret");
  EXPECT_TRUE(log.has("was readable by others")) << log.text();
  EXPECT_EQ(fs::status(token).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(PrivateFile, ThatIsALinkIsRefused) {
  const fs::path link = folder / "link";
  fs::create_symlink(file("secret"), link);
  EXPECT_NE(refusal([&] { runtime::read_private(link); }).find("is a link"), std::string::npos);
}

TEST_F(PrivateFile, OfAnotherUserIsRefusedWithTheLineToType) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  const fs::path token = file("secret");
  ASSERT_EQ(::chown(token.c_str(), kNobody, kNobody), 0);
  const std::string said = refusal([&] { runtime::read_private(token); });
  EXPECT_NE(said.find("sudo chown -R root '" + token.string() + "'"), std::string::npos) << said;
}

TEST_F(PrivateFile, AFolderThatAllMayWriteIsNoDataFolder) {
  fs::permissions(folder, fs::perms::all);
  const std::string said = refusal([&] { config::DataFolder{folder}; });
  EXPECT_NE(said.find("chmod o-w '" + folder.string() + "'"), std::string::npos) << said;
  EXPECT_FALSE(fs::exists(folder / "rheonaut.lock"));
}

TEST_F(PrivateFile, AFolderOfAnotherUserIsNoDataFolder) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a folder away";
  ASSERT_EQ(::chown(folder.c_str(), kNobody, kNobody), 0);
  const std::string said = refusal([&] { config::DataFolder{folder}; });
  EXPECT_NE(said.find("sudo chown -R root"), std::string::npos) << said;
  ASSERT_EQ(::chown(folder.c_str(), 0, 0), 0);
  EXPECT_EQ(refusal([&] { config::DataFolder{folder}; }), "");
}

TEST_F(PrivateFile, AFolderOfRootIsRefusedToOthersWithItsOwnerAndTheLineToType) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be somebody else";
  std::ofstream{folder / "closed.toml"} << "x";
  ASSERT_EQ(::chmod((folder / "closed.toml").c_str(), 0600), 0);
  ASSERT_EQ(::seteuid(kNobody), 0);
  const std::string said = refusal([&] { config::DataFolder{folder}; });
  const std::string inside = refusal([&] { config::DataFolder{folder / "new"}; });
  const std::string unread = runtime::denial(folder / "closed.toml", EACCES);
  ASSERT_EQ(::seteuid(0), 0);
  const std::string owner =
      "'" + folder.string() + "' belongs to root (mode 0700), and this program runs as nobody; run it as root";
  EXPECT_EQ(said, "cannot open '" + folder.string() + "/rheonaut.lock': " + owner +
                      ", or type: sudo chown -R nobody '" + folder.string() + "'");
  EXPECT_TRUE(inside.ends_with(owner)) << inside << ": what is not its own is not given away";
  EXPECT_EQ(unread, owner);
}

TEST_F(PrivateFile, AFolderThatItsGroupMayWriteIsUsedWithAWarning) {
  ASSERT_EQ(::chmod(folder.c_str(), 0770), 0);
  const CapturedLog log;
  EXPECT_EQ(refusal([&] { config::DataFolder{folder}; }), "");
  EXPECT_NE(log.text().find("chmod g-w"), std::string::npos) << log.text();
}

TEST_F(PrivateFile, TheLockOfAFolderSaysWhichProgramHoldsIt) {
  std::ofstream{folder / "rheonaut.lock"} << "rheonaut of an earlier and longer command line (pid 1)\n";
  {
    const auto lock = config::FolderLock::try_take(folder);
    ASSERT_TRUE(lock);
    EXPECT_FALSE(config::FolderLock::try_take(folder));
    const std::string holder = config::FolderLock::holder(folder);
    EXPECT_EQ(holder.find("server_config_test"), 0U) << holder;
    EXPECT_TRUE(holder.ends_with(" (pid " + std::to_string(::getpid()) + ")")) << holder;
    const std::string said = refusal([&] { config::DataFolder{folder}; });
    EXPECT_EQ(said.find(holder + " uses '" + folder.string() + "'; stop it"), 0U) << said;
  }
  EXPECT_TRUE(config::FolderLock::try_take(folder));
}

// A link under the name of the draft, or of the file, leads nowhere.
TEST_F(PrivateFile, LinksThatArePlantedBesideTheDatabaseAreNotFollowed) {
  const fs::path elsewhere = folder / "elsewhere";
  std::ofstream{elsewhere} << "precious";
  for (const char* planted : {"endpoints.json.new", "endpoints.json"}) fs::create_symlink(elsewhere, folder / planted);
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  {
    config::DataFolder data{folder};
    runtime::run_first(loop, data.announce(clock, {"127.0.0.1:1", "127.0.0.1:2", "", ""}));
    EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(folder / "endpoints.json")));
  }
  std::string content;
  std::ifstream{elsewhere} >> content;
  EXPECT_EQ(content, "precious");
  fs::remove(folder / "rheonaut.lock");
  fs::create_symlink(folder / "made", folder / "rheonaut.lock");
  EXPECT_NE(refusal([&] { config::DataFolder{folder}; }).find("rheonaut.lock"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "made"));
}

}  // namespace
}  // namespace server
