// Parameters and controller in flash: kept over a power cut at any byte, and never written with the motor on.
#include "robot_fw/esp8266/flash_storage.hpp"

#include <gtest/gtest.h>

#include <string>

#include "chip.hpp"

namespace robot_fw::esp8266 {
namespace {

class Flash : public ::testing::Test {
 protected:
  Flash() {
    chip = Chip{};
    motor.begin();
  }
  static bool save(FlashStorage& storage, StorageKey key, const std::string& text) {
    return storage.save(key, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  }
  static std::string load(FlashStorage& storage, StorageKey key) {
    std::uint8_t bytes[Storage::kMaxBytes];
    const std::size_t size = storage.load(key, bytes, sizeof(bytes));
    return {bytes, bytes + size};
  }
  // What a robot finds that boots now.
  std::string after_boot(StorageKey key = StorageKey::parameters) {
    FlashStorage storage{motor};
    storage.begin();
    return load(storage, key);
  }
  void keep(const std::string& text, StorageKey key = StorageKey::parameters) {
    FlashStorage storage{motor};
    storage.begin();
    ASSERT_TRUE(save(storage, key, text));
    storage.write_pending();
  }
  Motor motor{kSettings.motor};
};

TEST_F(Flash, IsEmptyAtFirst) {
  EXPECT_EQ(after_boot(), "");
  EXPECT_EQ(after_boot(StorageKey::controller), "");
}

TEST_F(Flash, KeepsBothValues) {
  keep("parameters");
  keep("controller", StorageKey::controller);
  EXPECT_EQ(after_boot(), "parameters");
  EXPECT_EQ(after_boot(StorageKey::controller), "controller");
}

TEST_F(Flash, WritesTakeTurns) {
  for (int i = 0; i < 7; ++i) {
    keep("value " + std::to_string(i));
    EXPECT_EQ(after_boot(), "value " + std::to_string(i));
  }
  EXPECT_EQ(chip.flash_erases, 7);
}

TEST_F(Flash, PowerCutAtAnyByteKeepsTheOlderRecord) {
  keep("first");
  keep("older");
  const std::vector<std::uint8_t> before = chip.flash;
  for (int cut = 0; cut < 452; ++cut) {
    chip.flash = before;
    chip.power_cut_after_bytes = cut;
    keep("newer");
    chip.reset(0);
    ASSERT_EQ(after_boot(), "older") << "cut after " << cut << " bytes";
  }
}

TEST_F(Flash, DecayedRecordIsNotTaken) {
  keep("older");
  keep("newer");
  chip.flash[kFlashSectorBytes + 20] ^= 1;
  EXPECT_EQ(after_boot(), "older");
  FlashStorage storage{motor};
  storage.begin();
  EXPECT_TRUE(storage.damaged());
}

TEST_F(Flash, ThatIsBlankOrSoundIsNotDamaged) {
  for (int writes = 0; writes < 3; ++writes) {
    FlashStorage storage{motor};
    storage.begin();
    EXPECT_FALSE(storage.damaged()) << writes;
    keep("value");
  }
}

TEST_F(Flash, IsNeverWrittenWithTheMotorOn) {
  FlashStorage storage{motor};
  storage.begin();
  motor.complete_tick(0.3F);
  EXPECT_TRUE(save(storage, StorageKey::parameters, "later"));
  for (int i = 0; i < 10; ++i) storage.write_pending();
  EXPECT_EQ(chip.flash_erases, 0);
  EXPECT_TRUE(storage.pending());
  motor.complete_tick(0);
  storage.write_pending();
  EXPECT_EQ(after_boot(), "later");
  EXPECT_FALSE(storage.pending());
}

TEST_F(Flash, ThatDoesNotTakeItIsTriedThreeTimes) {
  FlashStorage storage{motor};
  storage.begin();
  save(storage, StorageKey::parameters, "x");
  chip.power_lost = true;
  int failures = 0;
  for (int i = 0; i < 10; ++i) failures += !storage.write_pending();
  EXPECT_EQ(failures, 1) << "said once, after the third";
  EXPECT_FALSE(storage.pending());
  EXPECT_EQ(load(storage, StorageKey::parameters), "x") << "it holds until the next boot";
}

TEST_F(Flash, ValueTooLargeForItsPlaceIsRefused) {
  FlashStorage storage{motor};
  storage.begin();
  EXPECT_FALSE(save(storage, StorageKey::parameters, std::string(161, 'x')));
  EXPECT_FALSE(save(storage, StorageKey::controller, std::string(273, 'x')));
  EXPECT_FALSE(storage.pending());
  EXPECT_TRUE(save(storage, StorageKey::parameters, std::string(160, 'x')));
  EXPECT_TRUE(save(storage, StorageKey::controller, std::string(272, 'y')));
  storage.write_pending();
  EXPECT_EQ(after_boot(), std::string(160, 'x'));
  EXPECT_EQ(after_boot(StorageKey::controller), std::string(272, 'y'));
}

TEST_F(Flash, LayoutWithoutRoomKeepsNothingAndSaysSo) {
  chip.flash_area_bytes = 0;
  FlashStorage storage{motor};
  storage.begin();
  EXPECT_FALSE(save(storage, StorageKey::parameters, "x"));
  storage.write_pending();
  EXPECT_EQ(chip.flash_erases, 0);
}

}  // namespace
}  // namespace robot_fw::esp8266
