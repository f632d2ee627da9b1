// Facts of the machine that end a station or damage its store: limits of the system, and the file system of its folder.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>

#include "server/config/file_system.hpp"
#include "server/config/resource_limits.hpp"

namespace server::config {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

TEST(FileSystem, NetworkDisksAndFatAreNamed) {
  EXPECT_EQ(unsuitable_file_system(0x6969), "NFS");
  EXPECT_EQ(unsuitable_file_system(0xFF534D42), "SMB");
  EXPECT_EQ(unsuitable_file_system(0xFFFFFFFFFF534D42), "SMB") << "of a system that gives it with a sign";
  EXPECT_EQ(unsuitable_file_system(0xFE534D42), "SMB");
  EXPECT_EQ(unsuitable_file_system(0x4D44), "FAT");
  EXPECT_EQ(unsuitable_file_system(0x2011BAB0), "FAT");
  EXPECT_EQ(unsuitable_file_system(0xEF53), "") << "ext4";
  EXPECT_EQ(unsuitable_file_system(0x01021994), "") << "tmpfs";
  EXPECT_EQ(unsuitable_file_system(std::filesystem::temp_directory_path() / "not" / "there"), "");
  EXPECT_THAT(unsuitable_in_words("NFS", "/lab"), HasSubstr("'/lab' is on NFS"));
}

TEST(ResourceLimits, AreReadAsTheSystemWritesThem) {
  const ResourceLimits limits = parse_limits(
      "Limit                     Soft Limit           Hard Limit           Units     \n"
      "Max cpu time              30                   60                   seconds   \n"
      "Max file size             1048576              unlimited            bytes     \n"
      "Max stack size            8388608              unlimited            bytes     \n"
      "Max open files            1024                 524288               files     \n"
      "Max address space         unlimited            unlimited            bytes     \n");
  EXPECT_EQ(limits.cpu_s, 60U);
  EXPECT_EQ(limits.file_bytes, 1048576U);
  EXPECT_EQ(limits.stack_bytes, 8388608U);
  EXPECT_EQ(limits.open_files, 524288U);
  EXPECT_FALSE(limits.address_bytes);
  EXPECT_TRUE(limits_of(::getpid()));
  EXPECT_FALSE(limits_of(-1));
}

TEST(ResourceLimits, ThatAreTooTightAreSaidWithTheRemedy) {
  const Config config;
  EXPECT_THAT(tight_limits({}, config), IsEmpty());
  EXPECT_THAT(tight_limits({{}, {}, {}, 8 << 20, 1 << 20}, config), IsEmpty());
  const auto tight = tight_limits({.file_bytes = 5'000'000,
                                   .cpu_s = 60,
                                   .address_bytes = 1'000'000'000,
                                   .stack_bytes = 64 << 10,
                                   .open_files = 100},
                                  config);
  ASSERT_EQ(tight.size(), 5U);
  EXPECT_THAT(tight[0].what, HasSubstr("a file may grow to 5 MB only"));
  EXPECT_THAT(tight[0].action, HasSubstr("ulimit -f unlimited"));
  EXPECT_THAT(tight[1].what, HasSubstr("after 60 s of computing"));
  EXPECT_THAT(tight[2].what, HasSubstr("1000 MB of address space"));
  EXPECT_THAT(tight[3].what, HasSubstr("64 kB of stack"));
  EXPECT_THAT(tight[4].what, HasSubstr("100 open files are allowed"));
}

TEST(ConfigPaths, BeginAtHomeAsAShellHasThem) {
  ASSERT_EQ(::setenv("HOME", "/home/ana", 1), 0);
  const Config config = parse_config(
      "[data]\ndir = \"~/lab\"\n[recording]\nbackup_dir = \"~\"\n[tls]\ncertificate = \"~ana/x\"\nkey = \"/k~/x\"\n",
      "a");
  EXPECT_EQ(config.data_dir, "/home/ana/lab");
  EXPECT_EQ(config.recording.backup_dir, "/home/ana");
  EXPECT_EQ(config.tls.certificate, "~ana/x");
  EXPECT_EQ(config.tls.key, "/k~/x");
}

}  // namespace
}  // namespace server::config
