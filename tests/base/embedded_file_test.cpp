// Files that were embedded are the files on the disk, byte for byte.
#include "base/embedded_file.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>

namespace embedded_test {

std::span<const base::EmbeddedFile> golden_files();  // tests/base/CMakeLists.txt says which

namespace {

const std::filesystem::path kData{TEST_DATA_DIR};

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

TEST(EmbeddedFile, HoldsTheBytesOfItsFileAndAZeroBehindThem) {
  const base::EmbeddedFile& frames = golden_files().front();
  EXPECT_EQ(frames.name, "frames");
  EXPECT_EQ(frames.content, bytes_of(kData / "golden_frames.txt"));
  EXPECT_EQ(frames.content.data()[frames.content.size()], '\0');
}

TEST(EmbeddedFile, OfAFolderAreAllFilesInItByTheirPaths) {
  const auto files = golden_files().subspan(1);
  const std::filesystem::path folder = kData / "goldens/help";
  const auto on_disk = std::distance(std::filesystem::directory_iterator{folder}, {});
  EXPECT_EQ(std::ssize(files), on_disk);  // a folder that is not there adds none
  EXPECT_TRUE(std::ranges::is_sorted(files, {}, &base::EmbeddedFile::name));
  for (const base::EmbeddedFile& file : files) {
    const std::string name{file.name.substr(std::string{"goldens/"}.size())};
    EXPECT_EQ(file.content, bytes_of(folder / name)) << name;
  }
}

TEST(EmbeddedFile, HasADigestOf32HexadecimalDigits) {
  for (const base::EmbeddedFile& file : golden_files()) {
    EXPECT_EQ(file.digest.size(), 32U);
    EXPECT_EQ(file.digest.find_first_not_of("0123456789abcdef"), std::string::npos);
  }
}

}  // namespace
}  // namespace embedded_test
