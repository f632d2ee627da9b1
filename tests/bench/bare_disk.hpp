// The second thread of the bare loop: stores full groups as the station does, one transaction per 100 ms, 50 rows with
// each step of SQLite.
#pragma once

#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "protocol/frame.hpp"
#include "server/runtime/real_time.hpp"
#include "server/storage/database/database.hpp"
#include "tests/bench/bare_groups.hpp"

namespace bare {

inline constexpr auto kCommitPeriod = std::chrono::milliseconds(100);
inline constexpr std::size_t kBlockRows = 50;

struct Durable {
  std::size_t robot;
  std::uint64_t next_seq;
};

class Disk {
 public:
  Disk(const std::string& path, bool in_real_time) : database_{path}, handle_{database_.handle().getHandle()} {
    exec("PRAGMA wal_autocheckpoint = 16384");
    std::string block = "INSERT INTO sample VALUES (?,?,?,?,?,?,?)";
    insert_sample_ = prepare(block.c_str());
    for (std::size_t row = 1; row < kBlockRows; ++row) block += ",(?,?,?,?,?,?,?)";
    insert_block_ = prepare(block.c_str());
    insert_segment_ = prepare(
        "INSERT INTO segment (boot_key, first_seq, last_seq, first_row, last_row, first_robot_time_us, period_us,"
        " first_received_at_us, received_at_us, utc_offset_us, clock_uncertainty_us, mode, sub_state, setpoint_m,"
        " disturbance_m, position_sd_m, controller_id, emergency_id, emergency_cause, flags, min_position_m,"
        " max_position_m, min_velocity_m_s, max_velocity_m_s, min_acceleration_m_s2, max_acceleration_m_s2, min_duty,"
        " max_duty, min_impedance_mv, max_impedance_mv, min_reference_m, max_reference_m)"
        " VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)");
    insert_robot_ = prepare("INSERT INTO robot (robot_id, enrolled_at_us) VALUES (?, ?)");
    insert_boot_ = prepare(
        "INSERT INTO boot (boot_key, boot_id, robot_id, reset_cause, firmware_version, sample_period_us,"
        " first_seen_at_us, connected_at_us, announced_next_seq, last_robot_time_us)"
        " VALUES (?, ?, ?, 'power_on', 'bare', 10000, ?, ?, 0, 0)");
    advance_row_ = prepare("UPDATE meta SET value = ? WHERE name = 'next_row'");
    advance_boot_ = prepare("UPDATE boot SET last_robot_time_us = ? WHERE boot_key = ?");
    thread_ = std::thread{[this, in_real_time] {
      if (in_real_time) server::runtime::set_priority(server::runtime::Priority::disk);
      work();
    }};
  }
  Disk(const Disk&) = delete;
  Disk& operator=(const Disk&) = delete;
  ~Disk() { finish(); }

  void add_robot(std::size_t robot, const std::string& id, std::uint64_t boot_id) {
    const std::lock_guard lock{mutex_};
    new_robots_.push_back({robot, id, boot_id});
  }
  void add(std::unique_ptr<Group> group) {
    const std::lock_guard lock{mutex_};
    full_.push_back(std::move(group));
  }
  std::unique_ptr<Group> empty_group() {
    const std::lock_guard lock{mutex_};
    if (free_.empty()) return std::make_unique<Group>();
    auto group = std::move(free_.back());
    free_.pop_back();
    return group;
  }
  void take_durable(std::vector<Durable>& into) {
    const std::lock_guard lock{mutex_};
    std::swap(into, durable_);
  }
  // Writes what is left; afterwards there are no more commits.
  void finish() {
    if (!thread_.joinable()) return;
    {
      const std::lock_guard lock{mutex_};
      ends_ = true;
    }
    wake_.notify_one();
    thread_.join();
    for (sqlite3_stmt* statement :
         {insert_sample_, insert_block_, insert_segment_, insert_robot_, insert_boot_, advance_row_, advance_boot_}) {
      sqlite3_finalize(statement);
    }
  }
  std::uint64_t commits() const { return commits_; }

 private:
  struct NewRobot {
    std::size_t robot;
    std::string id;
    std::uint64_t boot_id;
  };

  void work() {
    auto due = std::chrono::steady_clock::now();
    for (;;) {
      due += kCommitPeriod;
      std::unique_lock lock{mutex_};
      const bool ends = wake_.wait_until(lock, due, [this] { return ends_; });
      std::swap(writing_, full_);
      const std::vector<NewRobot> robots = std::exchange(new_robots_, {});
      lock.unlock();
      if (!writing_.empty() || !robots.empty()) write(robots);
      lock.lock();
      for (auto& group : writing_) {
        durable_.push_back({group->robot, group->head.first_seq + group->count});
        free_.push_back(std::move(group));
      }
      writing_.clear();
      if (ends) return;
    }
  }

  void write(const std::vector<NewRobot>& robots) {
    exec("BEGIN IMMEDIATE");
    for (const NewRobot& robot : robots) {
      const std::int64_t now_us = utc_us();
      sqlite3_bind_text(insert_robot_, 1, robot.id.data(), static_cast<int>(robot.id.size()), SQLITE_STATIC);
      sqlite3_bind_int64(insert_robot_, 2, now_us);
      run(insert_robot_);
      sqlite3_bind_int64(insert_boot_, 1, key(robot.robot));
      sqlite3_bind_int64(insert_boot_, 2, static_cast<std::int64_t>(robot.boot_id));
      sqlite3_bind_text(insert_boot_, 3, robot.id.data(), static_cast<int>(robot.id.size()), SQLITE_STATIC);
      sqlite3_bind_int64(insert_boot_, 4, now_us);
      sqlite3_bind_int64(insert_boot_, 5, now_us);
      run(insert_boot_);
    }
    for (const auto& group : writing_) write(*group);
    sqlite3_bind_int64(advance_row_, 1, next_row_);
    run(advance_row_);
    exec("COMMIT");
    ++commits_;
  }

  void write(const Group& group) {
    const std::int64_t first_row = next_row_;
    std::array<float, kChannels> min, max;
    min.fill(NAN);
    max.fill(NAN);
    for (std::size_t i = 0; i < group.count;) {
      const std::size_t rows = group.count - i >= kBlockRows ? kBlockRows : 1;
      write_rows(rows == 1 ? insert_sample_ : insert_block_, group, i, rows);
      for (const std::size_t end = i + rows; i < end; ++i) {
        for (std::size_t channel = 0; channel < kChannels; ++channel) {
          min[channel] = std::fmin(min[channel], group.rows[i][channel]);
          max[channel] = std::fmax(max[channel], group.rows[i][channel]);
        }
      }
    }
    write_segment(group, first_row, min, max);
    sqlite3_bind_int64(advance_boot_, 1, static_cast<std::int64_t>(group.head.first_robot_time_us));
    sqlite3_bind_int64(advance_boot_, 2, key(group.robot));
    run(advance_boot_);
  }

  void write_rows(sqlite3_stmt* statement, const Group& group, std::size_t first, std::size_t rows) {
    int column = 0;
    for (std::size_t i = first; i < first + rows; ++i) {
      sqlite3_bind_int64(statement, ++column, next_row_++);
      for (const float value : group.rows[i]) sqlite3_bind_double(statement, ++column, value);
    }
    run(statement);
  }

  void write_segment(const Group& group, std::int64_t first_row, const std::array<float, kChannels>& min,
                     const std::array<float, kChannels>& max) {
    const Telemetry& head = group.head;
    int column = 0;
    const auto integer = [&](auto value) {
      sqlite3_bind_int64(insert_segment_, ++column, static_cast<std::int64_t>(value));
    };
    const auto real = [&](float value) { sqlite3_bind_double(insert_segment_, ++column, value); };
    const auto text = [&](const char* value) {
      sqlite3_bind_text(insert_segment_, ++column, value, -1, SQLITE_STATIC);
    };
    const auto first_seq = static_cast<std::int64_t>(head.first_seq);
    const auto first_time_us = static_cast<std::int64_t>(head.first_robot_time_us);
    for (const std::int64_t value :
         {key(group.robot), first_seq, first_seq + static_cast<std::int64_t>(group.count) - 1, first_row, next_row_ - 1,
          first_time_us, std::int64_t{head.period_us}, group.first_received_us, group.received_us,
          group.first_received_us - first_time_us, std::int64_t{-1}}) {
      integer(value);
    }
    text(protocol::text(static_cast<protocol::Mode>(head.mode)));
    text(protocol::text(static_cast<protocol::SubState>(head.sub_state)));
    for (const float value : {head.setpoint_m, head.disturbance_m, head.position_sd_m}) real(value);
    integer(head.controller_id);
    integer(head.emergency_id);
    text(protocol::text(static_cast<protocol::EmergencyCause>(head.cause)));
    integer(head.flags);
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      real(min[channel]);
      real(max[channel]);
    }
    run(insert_segment_);
  }

  static std::int64_t key(std::size_t robot) { return static_cast<std::int64_t>(robot) + 1; }
  void check(int result) {
    if (result != SQLITE_OK && result != SQLITE_DONE) throw std::runtime_error{sqlite3_errmsg(handle_)};
  }
  void exec(const char* sql) { check(sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr)); }
  void run(sqlite3_stmt* statement) {
    check(sqlite3_step(statement));
    sqlite3_reset(statement);
  }
  sqlite3_stmt* prepare(const char* sql) {
    sqlite3_stmt* statement = nullptr;
    check(sqlite3_prepare_v2(handle_, sql, -1, &statement, nullptr));
    return statement;
  }

  server::storage::Database database_;
  sqlite3* handle_;
  sqlite3_stmt *insert_sample_, *insert_block_, *insert_segment_, *insert_robot_, *insert_boot_, *advance_row_,
      *advance_boot_;
  std::int64_t next_row_ = 1;
  std::uint64_t commits_ = 0;
  std::vector<std::unique_ptr<Group>> writing_;  // of the second thread

  std::mutex mutex_;  // of what follows
  std::condition_variable wake_;
  std::vector<std::unique_ptr<Group>> full_, free_;
  std::vector<NewRobot> new_robots_;
  std::vector<Durable> durable_;
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace bare
