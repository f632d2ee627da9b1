// A chip made of variables: time, pins, the timer's interrupt, I2C, Wi-Fi and one socket, flash and RTC memory.
//
// The stubs of the Arduino core beside this file read and write it. Time passes only in pass(), and in calls that take
// time on the chip (handshake, erasing, a flush that waits); the timer's interrupt runs meanwhile, as on the chip.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <vector>

constexpr std::uint64_t kCyclesPerUs = 80;
constexpr std::uint32_t kFlashSectorBytes = 4096;

struct Pin {
  bool output = false;
  bool latch = false;        // as a soft reset leaves it
  bool driven_high = false;  // an input, from outside
  int rises = 0;             // when it became an output, its latch high
  std::uint64_t high_us = 0;
};

struct Socket {
  // What the network does.
  bool answers = true;     // false: nobody is there, not even to refuse
  bool refuses = false;    // at once: the machine is there, the station is not
  bool knows_name = true;  // false: no answer to the question for the host's address either
  bool agrees_on_fragments = true;
  std::uint64_t handshake_takes_us = 3'000'000;
  std::size_t room = 1072;   // what TCP takes at once
  bool acknowledges = true;  // at once, so that the room stays
  bool takes = true;         // false: lwIP is out of memory or of places in its queue, whatever its room
  std::deque<std::uint8_t> incoming;
  // What the robot did.
  bool connected = false;
  bool no_delay = false;
  unsigned long timeout_ms = 5'000;
  std::string known_key;
  int receive_bytes = 16'384, send_bytes = 512;
  int ciphers = 0;
  int dials = 0, closes = 0;
  std::vector<std::uint64_t> attempt_began_us, attempt_failed_us;
  int waiting_flushes = 0;  // each waits for the peer's acknowledgement
  std::vector<std::vector<std::uint8_t>> writes;
  // Inside TLS.
  std::size_t sealed = 0;       // of a record that TCP does not have yet
  bool input_is_found = false;  // by available(), which does nothing until that is read
};

struct Chip {
  std::uint64_t now_us = 0;
  std::uint64_t counter_us = 0;  // what the microsecond counter said at 0
  std::array<Pin, 17> pins;
  std::uint32_t (*timer)() = nullptr;
  std::uint64_t timer_at_us = 0;
  int analogue = 0;  // counts
  int analogue_with_supply = 0;
  std::int8_t supply_pin = -1;  // high: the supply is on the input

  std::array<std::uint8_t, 256> imu_registers{};
  bool imu_there = true;
  bool imu_holds_data_line = false;  // in the middle of a byte, until it is clocked
  int imu_reads_to_fail = 0;         // the next ones
  std::uint64_t imu_read_takes_us = 0;
  int bus_starts = 0;

  bool wifi_there = true;
  std::uint64_t join_takes_us = 1'000'000;
  bool wifi_begun = false, wifi_persistent = true, wifi_reconnects = true, wifi_sleeps = true;
  std::uint64_t joined_at_us = 0;
  int joins = 0;
  Socket socket;

  std::uint32_t reset_reason = 0;
  std::array<std::uint32_t, 128> rtc_memory{};
  std::array<std::uint32_t, 4096> instruction_ram{};  // words: on the chip anything narrower is an exception
  std::size_t instruction_ram_bytes = 16'384;
  std::vector<std::uint8_t> flash = std::vector<std::uint8_t>(2 * kFlashSectorBytes, 0xFF);
  std::uint32_t flash_area_bytes = 2 * kFlashSectorBytes;
  int flash_erases = 0, flash_writes = 0;
  std::uint64_t erase_takes_us = 100'000;
  int power_cut_after_bytes = -1;  // of the next write; -1: none
  bool power_lost = false;
  std::uint32_t random_state = 1;
  int watchdog_enables = 0, watchdog_feeds = 0;

  std::function<void()> before_blocking;  // called by whatever stops the program for long

  // Time passes and interrupts run.
  void pass(std::uint64_t us);
  // The level outside: a pin that is no output is held low by its resistor.
  bool level(int pin) const {
    return pins[static_cast<std::size_t>(pin)].output && pins[static_cast<std::size_t>(pin)].latch;
  }
  void write_latch(std::uint32_t mask, bool high);
  bool wifi_joined() const { return wifi_there && wifi_begun && now_us >= joined_at_us; }
  void blocks(std::uint64_t us);

  // A reset: the program starts anew with the time at 0; pins keep their latch, memories what they held.
  void reset(std::uint32_t reason);
  // Power off and on: RTC memory is noise, flash is kept.
  void power_cycle();
};

inline Chip chip;
