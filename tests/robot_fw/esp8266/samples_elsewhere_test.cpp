// The samples of the ring that lie in instruction RAM: where, whether they are right, and what happens without it.
#include <cstdint>
#include <map>

#include "board_fixture.hpp"
#include "robot_fw/esp8266/instruction_ram.hpp"

namespace robot_fw::esp8266 {
namespace {

constexpr std::size_t kWordsElsewhere = kSamplesElsewhere * sizeof(Sample) / 4;
constexpr std::uint32_t kUntouched = 0xDEADBEEF;

class SamplesElsewhere : public BoardFixture {
 protected:
  SamplesElsewhere() { chip.instruction_ram.fill(kUntouched); }

  bool touched(std::size_t first_word, std::size_t end_word) const {
    for (std::size_t i = first_word; i < end_word; ++i) {
      if (chip.instruction_ram[i] != kUntouched) return true;
    }
    return false;
  }

  // Runs under a station that stores nothing, the electrode another value in each tick; what came, by seq.
  std::map<std::uint64_t, float> impedances_mv(int ticks) {
    std::map<std::uint64_t, float> heard_mv;
    for (int tick = 0; tick < ticks; ++tick) {
      chip.analogue = 100 + analogue_turn++ % 397;
      if (tick % 10 == 0) heartbeat();
      run_ms(10);
      for (const protocol::RobotFrame& frame : received()) {
        if (frame.which_body != rheonaut_RobotFrame_telemetry_tag) continue;
        const protocol::Telemetry& batch = frame.body.telemetry;
        for (pb_size_t i = 0; i < batch.impedance_mv_count; ++i) {
          heard_mv[batch.first_seq + i] = batch.impedance_mv[i];
        }
      }
    }
    return heard_mv;
  }
  int analogue_turn = 0;
};

TEST_F(SamplesElsewhere, TakeTheirShareOfInstructionRamAndNoMore) {
  ASSERT_EQ(kSamplesElsewhere, 320U);
  connect();
  impedances_mv(900);
  for (std::size_t word = 0; word < kWordsElsewhere; ++word) {
    ASSERT_TRUE(touched(word, word + 1)) << "word " << word;
  }
  EXPECT_FALSE(touched(kWordsElsewhere, chip.instruction_ram.size()));
}

TEST_F(SamplesElsewhere, RingIsSmallerByThem) {
  EXPECT_LE(sizeof(TelemetryRing), 13'500U);  // the memory table of docs/robot.md
}

TEST_F(SamplesElsewhere, AreReadAsTheyWereWrittenAcrossBothBorders) {
  TelemetryRing::set_memory_elsewhere(static_cast<Sample*>(instruction_ram(kWordsElsewhere * 4)));
  TelemetryRing ring;
  for (int i = 0; i < 2'000; ++i) {
    const float v = static_cast<float>(i);
    ring.push({v, v + 0.1F, v + 0.2F, v + 0.3F, v + 0.4F, v + 0.5F}, {}, false, static_cast<std::uint64_t>(i) * 10'000,
              10'000);
  }
  ASSERT_EQ(ring.oldest_seq(), 1'200U);
  std::uint64_t seq = ring.oldest_seq();
  while (seq < ring.next_seq()) {
    protocol::Telemetry batch;
    ring.read(seq, 7, batch);
    ASSERT_GT(batch.position_m_count, 0);
    for (pb_size_t i = 0; i < batch.position_m_count; ++i, ++seq) {
      const float v = static_cast<float>(seq);
      ASSERT_EQ(batch.position_m[i], v);
      ASSERT_EQ(batch.velocity_m_s[i], v + 0.1F);
      ASSERT_EQ(batch.acceleration_m_s2[i], v + 0.2F);
      ASSERT_EQ(batch.duty[i], v + 0.3F);
      ASSERT_EQ(batch.impedance_mv[i], v + 0.4F);
      ASSERT_EQ(batch.reference_m[i], v + 0.5F);
    }
  }
}

TEST_F(SamplesElsewhere, BackfillRepeatsWhatWasSentLive) {
  connect();
  const std::map<std::uint64_t, float> live_mv = impedances_mv(1'250);
  ASSERT_GT(live_mv.size(), 1'200U);
  const int dials = chip.socket.dials;
  chip.socket.connected = false;
  run_ms(10);
  come_up();
  ASSERT_EQ(chip.socket.dials, dials + 1);
  const std::map<std::uint64_t, float> again_mv = impedances_mv(600);
  std::size_t compared = 0;
  for (const auto& [seq, value_mv] : live_mv) {
    const auto found = again_mv.find(seq);
    if (found == again_mv.end()) continue;
    ++compared;
    EXPECT_EQ(found->second, value_mv) << "seq " << seq;
  }
  EXPECT_GT(compared, 300U);
  for (const std::uint64_t seq : {800U + kSamplesElsewhere - 1, 800U + kSamplesElsewhere}) {
    EXPECT_TRUE(live_mv.count(seq) == 1 && again_mv.count(seq) == 1) << "seq " << seq << ", at the border";
  }
}

TEST_F(SamplesElsewhere, WithoutRoomThereIsNoRobotAndTheLedSaysSo) {
  for (const std::size_t room_bytes : {std::size_t{0}, kWordsElsewhere * 4 - 4}) {
    chip.instruction_ram_bytes = room_bytes;
    chip.pins[kMotorPin].latch = true;  // as a reset may leave it
    boot();
    EXPECT_FALSE(board->has_robot());
    EXPECT_EQ(board->led_pattern(), LedPattern::refused);
    const auto led = static_cast<std::size_t>(kSettings.led.pin);
    const std::uint64_t dark_before_us = chip.pins[led].high_us;
    EXPECT_EQ(motor_high_us([this] { run_ms(10'000); }), 0U);
    EXPECT_FALSE(chip.level(kMotorPin));
    EXPECT_TRUE(chip.pins[kMotorPin].output) << "driven low, not left open";
    EXPECT_NEAR(static_cast<double>(chip.pins[led].high_us - dark_before_us), 8'500'000, 20'000)
        << "low lights it: three flashes of 0.1 s in 2 s";
    EXPECT_EQ(chip.joins, 0) << "nobody is dialled";
    EXPECT_FALSE(touched(0, chip.instruction_ram.size()));
  }
  chip.instruction_ram_bytes = kWordsElsewhere * 4;
  boot();
  EXPECT_TRUE(board->has_robot());
}

}  // namespace
}  // namespace robot_fw::esp8266
