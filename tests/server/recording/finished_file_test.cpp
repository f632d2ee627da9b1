// A file that is moved to another disk is there whole, or the first one stays.
#include "server/storage/database/finished_file.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;

class FinishedFileTest : public RecordingTest {
 protected:
  fs::path made(const std::string& name, const std::string& content) const {
    std::ofstream{folder_ / name, std::ios::binary} << content;
    return folder_ / name;
  }
  static std::string content_of(const fs::path& path) {
    std::ifstream in{path, std::ios::binary};
    return {std::istreambuf_iterator<char>{in}, {}};
  }

  std::string large_ = std::string(3'000'000, 'a') + "end";
};

TEST_F(FinishedFileTest, ACopyIsComparedByteByByte) {
  const fs::path file = made("file", large_);
  EXPECT_TRUE(storage::holds_the_same(file, made("copy", large_)));
  std::string changed = large_;
  changed.back() = 'x';
  EXPECT_FALSE(storage::holds_the_same(file, made("changed", changed)));
  EXPECT_FALSE(storage::holds_the_same(file, made("short", large_.substr(0, 2'000'000))));
  EXPECT_FALSE(storage::holds_the_same(file, made("long", large_ + "e")));
  EXPECT_FALSE(storage::holds_the_same(file, folder_ / "none"));
  EXPECT_TRUE(storage::holds_the_same(made("empty", ""), made("empty too", "")));
}

TEST_F(FinishedFileTest, ACopyBecomesVisibleWhole) {
  const fs::path file = made("file", large_);
  made("there.part", "of an earlier attempt");
  storage::copy_finished(file, folder_ / "there");
  EXPECT_EQ(content_of(folder_ / "there"), large_);
  EXPECT_FALSE(fs::exists(folder_ / "there.part"));
  EXPECT_TRUE(fs::exists(file));
  EXPECT_THROW(storage::copy_finished(folder_ / "none", folder_ / "nowhere"), std::system_error);
  EXPECT_FALSE(fs::exists(folder_ / "nowhere"));
}

TEST_F(FinishedFileTest, WhatIsNotThereWholeLeavesTheFirstOne) {
  const fs::path file = made("file", large_);
  EXPECT_THROW(storage::move_finished(file, folder_ / "no folder" / "there"), std::system_error);
  EXPECT_EQ(content_of(file), large_);
  storage::move_finished(file, folder_ / "there");
  EXPECT_EQ(content_of(folder_ / "there"), large_);
  EXPECT_FALSE(fs::exists(file));
}

}  // namespace
}  // namespace server
