// A file is read whole or not at all, and never more than the bound.
#include "base/whole_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

namespace base {
namespace {

namespace fs = std::filesystem;

class WholeFileTest : public ::testing::Test {
 protected:
  ~WholeFileTest() override { fs::remove_all(folder_); }
  static fs::path made() {
    std::string name = (fs::temp_directory_path() / "rheonaut-whole-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error{"no temporary folder"};
    return name;
  }
  fs::path saved(const std::string& text) const {
    std::ofstream{folder_ / "file"} << text;
    return folder_ / "file";
  }

  fs::path folder_ = made();
};

TEST_F(WholeFileTest, IsReadUpToTheBoundAndNotBeyond) {
  const fs::path file = saved(std::string(100'000, 'x'));
  const WholeFile whole = read_whole(file, 100'000);
  EXPECT_EQ(whole.problem, "");
  EXPECT_EQ(whole.text, std::string(100'000, 'x'));
  EXPECT_EQ(read_whole(file, 99'999).problem, "has more than 99999 bytes: 100000");
  EXPECT_EQ(read_whole(file, 99'999).text, "");
  EXPECT_EQ(read_whole(saved(""), 10).problem, "");
}

// More than there is memory for: a program that began to read it would not come to an end.
TEST_F(WholeFileTest, ThatIsTooLongIsNotBegun) {
  fs::resize_file(saved("x"), std::uintmax_t{1} << 40);
  EXPECT_EQ(read_whole(folder_ / "file", std::size_t{1} << 39).problem,
            "has more than 549755813888 bytes: 1099511627776");
}

TEST_F(WholeFileTest, OfADeviceWithoutEndIsRefusedAtTheBound) {
  EXPECT_EQ(read_whole(fs::path{"/dev/zero"}, 1 << 20).problem, "has more than 1048576 bytes");
}

TEST_F(WholeFileTest, ALineIsReadUpToTheBoundAndNotBeyond) {
  std::istringstream lines{"first\r\n\nthird"};
  EXPECT_EQ(read_line(lines, 6).text, "first");
  EXPECT_EQ(read_line(lines, 6).problem, "");
  EXPECT_EQ(read_line(lines, 5).text, "third");
  EXPECT_EQ(read_line(lines, 6).problem, "has no line");
  std::istringstream longer{"longer\n"};
  EXPECT_EQ(read_line(longer, 5).problem, "has more than 5 bytes");
  std::ifstream endless{"/dev/zero"};
  EXPECT_EQ(read_line(endless, 1 << 16).problem, "has more than 65536 bytes");
}

TEST_F(WholeFileTest, OfAPipeIsReadToItsEnd) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::thread writer{[&pipe] { std::ofstream{pipe} << "through the pipe"; }};
  EXPECT_EQ(read_whole(pipe, 100).text, "through the pipe");
  writer.join();
}

TEST_F(WholeFileTest, ThatIsAFolderOrNotThereSaysSo) {
  EXPECT_EQ(read_whole(folder_, 10).problem, "is a folder; give a file");
  const WholeFile missing = read_whole(folder_ / "missing", 10);
  EXPECT_EQ(missing.problem, "cannot be read: No such file or directory");
  EXPECT_EQ(missing.error, ENOENT);
}

}  // namespace
}  // namespace base
