// The least that can record robots and stop them: the yardstick of tests/bench/recording_bench and
// tests/bench/stop_bench. LONG: it is one file on purpose.
//
//   bare_loop DATABASE         receives, and stores as the station does: the same tables, rows, settings and durability
//   bare_loop --no-disk        receives and acknowledges, stores nothing
//   bare_loop --bytes          reads and throws away: what the kernel alone costs
//
// One thread reads whatever sockets are ready, decodes frames where they lie and fills groups of 100 samples; none of
// it allocates per frame. A second thread writes the full groups, one transaction per 100 ms, and says what is durable.
// Each robot gets the acknowledgements, signs of life and clock probes that the station sends.
//
// A request on its HTTP port, whatever it says, is a stop of the robot that it names between the fourth slash and the
// fifth: the frame is sent in the same turn, and the robot's answer is the answer. Pages get samples and stamps there,
// as on the station's /live.
//
// It believes everything: no checks of values, no gaps, no duplicates, no reconnects, no other commands, no second
// robot of a name, no full queue, no failing disk, no record of a stop. Prints its ports, robots' and HTTP; ends when
// its input does, with a line of JSON.
#include <netinet/tcp.h>
#include <sqlite3.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <iostream>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "protocol/frame.hpp"
#include "server/storage/database/database.hpp"
#include "tests/bench/bare_stops.hpp"
#include "tests/bench/bare_views.hpp"
#include "tests/bench/bare_wire.hpp"

namespace {

using bare::WireReader;

constexpr std::size_t kChannels = 6;
constexpr std::size_t kGroupSamples = 100;
constexpr std::int64_t kHeartbeatUs = 200'000, kProbeUs = 1'000'000, kGroupAgeUs = 1'000'000;
constexpr auto kCommitPeriod = std::chrono::milliseconds(100);

template <class Time>
std::int64_t microseconds(Time now) {
  return std::chrono::duration_cast<std::chrono::microseconds>(now.time_since_epoch()).count();
}
std::int64_t steady_us() { return microseconds(std::chrono::steady_clock::now()); }
std::int64_t utc_us() { return microseconds(std::chrono::system_clock::now()); }

// What a telemetry frame says beside its samples, and where those lie in it.
struct Telemetry {
  std::uint64_t first_seq = 0, first_robot_time_us = 0, emergency_id = 0;
  std::uint32_t period_us = 0, mode = 0, sub_state = 0, controller_id = 0, flags = 0, cause = 0, padding = 0;
  float setpoint_m = NAN, disturbance_m = 0, position_sd_m = 0;
  std::size_t samples = 0;
  std::array<const std::uint8_t*, kChannels> columns{};

  bool same_context(const Telemetry& other) const {
    return std::memcmp(&emergency_id, &other.emergency_id,
                       offsetof(Telemetry, samples) - offsetof(Telemetry, emergency_id)) == 0;
  }
};

// Up to 100 samples of one context, a row each.
struct Group {
  std::size_t robot = 0;
  Telemetry head;
  std::size_t count = 0;
  std::int64_t first_received_us = 0, received_us = 0, began_us = 0;
  std::array<std::array<float, kChannels>, kGroupSamples> rows;
};

struct Robot {
  int fd = -1;
  std::string id;
  std::uint64_t boot_id = 0, heard_next_seq = 0, durable_next_seq = 0;
  std::int64_t heartbeat_due_us = 0, probe_due_us = 0;
  std::unique_ptr<Group> group;
  bare::View* view = nullptr;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> rest;  // of a frame that is not complete
  std::size_t rest_size = 0;
};

void read_telemetry(WireReader in, Telemetry& to) {
  while (in.more()) {
    const std::uint64_t tag = in.varint();
    const std::uint64_t field = tag >> 3;
    if (field >= 16 && field < 16 + kChannels) {
      const WireReader column = in.message();
      to.columns[field - 16] = column.at();
      to.samples = column.size() / sizeof(float);
      continue;
    }
    switch (field) {
      case 1: to.first_seq = in.varint(); break;
      case 2: to.first_robot_time_us = in.varint(); break;
      case 3: to.period_us = static_cast<std::uint32_t>(in.varint()); break;
      case 5: to.mode = static_cast<std::uint32_t>(in.varint()); break;
      case 6: to.sub_state = static_cast<std::uint32_t>(in.varint()); break;
      case 7: to.setpoint_m = in.fixed<float>(); break;
      case 8: to.disturbance_m = in.fixed<float>(); break;
      case 9: to.position_sd_m = in.fixed<float>(); break;
      case 10: to.controller_id = static_cast<std::uint32_t>(in.varint()); break;
      case 11: to.emergency_id = in.fixed<std::uint64_t>(); break;
      case 12: to.flags = static_cast<std::uint32_t>(in.varint()); break;
      case 13: to.cause = static_cast<std::uint32_t>(in.varint()); break;
      default: in.skip_value(tag & 7); break;
    }
  }
}

// ---------------------------------------------------------------- the second thread

struct Durable {
  std::size_t robot;
  std::uint64_t next_seq;
};

class Disk {
 public:
  explicit Disk(const std::string& path) : database_{path}, handle_{database_.handle().getHandle()} {
    exec("PRAGMA wal_autocheckpoint = 16384");
    insert_sample_ = prepare("INSERT INTO sample VALUES (?,?,?,?,?,?,?)");
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
    thread_ = std::thread{[this] { work(); }};
  }
  Disk(const Disk&) = delete;
  Disk& operator=(const Disk&) = delete;
  ~Disk() { finish(); }

  void add_robot(std::size_t robot, const Robot& from) {
    const std::lock_guard lock{mutex_};
    new_robots_.push_back({robot, from.id, from.boot_id});
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
         {insert_sample_, insert_segment_, insert_robot_, insert_boot_, advance_row_, advance_boot_}) {
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
    for (std::size_t i = 0; i < group.count; ++i) {
      sqlite3_bind_int64(insert_sample_, 1, next_row_++);
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        const float value = group.rows[i][channel];
        sqlite3_bind_double(insert_sample_, static_cast<int>(channel) + 2, value);
        min[channel] = std::fmin(min[channel], value);
        max[channel] = std::fmax(max[channel], value);
      }
      run(insert_sample_);
    }
    write_segment(group, first_row, min, max);
    sqlite3_bind_int64(advance_boot_, 1, static_cast<std::int64_t>(group.head.first_robot_time_us));
    sqlite3_bind_int64(advance_boot_, 2, key(group.robot));
    run(advance_boot_);
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

  server::Database database_;
  sqlite3* handle_;
  sqlite3_stmt *insert_sample_, *insert_segment_, *insert_robot_, *insert_boot_, *advance_row_, *advance_boot_;
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

// ---------------------------------------------------------------- the first thread

class BareLoop {
 public:
  BareLoop(std::unique_ptr<Disk> disk, bool decodes) : disk_{std::move(disk)}, decodes_{decodes} {
    robots_.reserve(30'000);
    watch(listener_, kListener);
    watch(desk_.listener(), kHttpListener);
    watch(STDIN_FILENO, kInput);
  }

  std::uint16_t port() const { return bare::port_of(listener_); }
  std::uint16_t http_port() const { return bare::port_of(desk_.listener()); }

  void run() {
    std::array<epoll_event, 256> ready{};
    for (;;) {
      const int count = epoll_wait(epoll_, ready.data(), static_cast<int>(ready.size()), 10);
      for (int i = 0; i < count; ++i) {
        const std::uint64_t who = ready[static_cast<std::size_t>(i)].data.u64;
        if (who == kInput) return;
        if (who == kListener) {
          accept_all();
        } else if (who == kHttpListener) {
          const int fd = desk_.accept_asker();
          if (fd >= 0) watch(fd, kFirstAsker + static_cast<std::uint64_t>(fd));
        } else if (who >= kFirstAsker) {
          take_request(static_cast<int>(who - kFirstAsker));
        } else {
          read(who);
        }
      }
      const std::int64_t now_us = steady_us();
      if (now_us - swept_us_ >= 10'000) sweep(now_us);
    }
  }

  void print_summary() {
    for (Robot& robot : robots_) close_group(robot);
    if (disk_) disk_->finish();
    std::cout << "{\"robots\":" << robots_.size() << ",\"frames\":" << frames_ << ",\"samples\":" << samples_
              << ",\"bytes\":" << bytes_ << ",\"commits\":" << (disk_ ? disk_->commits() : 0) << "}" << std::endl;
  }

 private:
  static constexpr std::uint64_t kListener = ~std::uint64_t{0}, kInput = kListener - 1;
  static constexpr std::uint64_t kHttpListener = kListener - 2, kFirstAsker = std::uint64_t{1} << 40;
  static constexpr std::size_t kSweeps = 20;  // slices of robots, one each 10 ms

  void watch(int fd, std::uint64_t who) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = who;
    epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event);
  }

  void accept_all() {
    for (int fd; (fd = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK)) >= 0;) {
      const int on = 1;
      setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      Robot& robot = robots_.emplace_back();
      robot.fd = fd;
      watch(fd, robots_.size() - 1);
    }
  }

  void take_request(int fd) {
    const std::string_view text = desk_.read(fd);
    if (text.empty() || views_.take(fd, text)) return;
    const auto robot = std::find_if(
        robots_.begin(), robots_.end(),
        [wish = bare::StopDesk::robot_of(text)](const Robot& one) { return one.fd >= 0 && one.id == wish; });
    if (robot == robots_.end()) return bare::StopDesk::answer(fd, "404 Not Found");
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    frame.body.command.command_id = desk_.new_stop(fd);
    frame.body.command.which_action = rheonaut_Command_emergency_stop_tag;
    send(*robot, frame);
  }

  void take_answer(WireReader ack) {
    while (ack.more()) {
      const std::uint64_t tag = ack.varint();
      if (tag >> 3 == rheonaut_CommandAck_command_id_tag) return desk_.answer_stop(ack.fixed<std::uint64_t>());
      ack.skip_value(tag & 7);
    }
  }

  void read(std::uint64_t who) {
    Robot& robot = robots_[who];
    std::memcpy(input_.data(), robot.rest.data(), robot.rest_size);
    const ssize_t got = recv(robot.fd, input_.data() + robot.rest_size, input_.size() - robot.rest_size, 0);
    if (got <= 0) {
      epoll_ctl(epoll_, EPOLL_CTL_DEL, robot.fd, nullptr);
      close(std::exchange(robot.fd, -1));
      return;
    }
    bytes_ += static_cast<std::uint64_t>(got);
    if (!decodes_ && !robot.id.empty()) return;
    const std::uint8_t* at = input_.data();
    const std::uint8_t* const end = at + robot.rest_size + got;
    while (at < end) {
      std::size_t prefix = 1, length = at[0];
      if (length >= 0x80) {
        if (end - at < 2) break;
        length = (length & 0x7F) | (std::size_t{at[1]} << 7);
        prefix = 2;
      }
      if (static_cast<std::size_t>(end - at) < prefix + length) break;
      take_frame(who, {at + prefix, at + prefix + length});
      at += prefix + length;
    }
    robot.rest_size = decodes_ ? static_cast<std::size_t>(end - at) : 0;
    std::memcpy(robot.rest.data(), at, robot.rest_size);
  }

  void take_frame(std::size_t who, WireReader in) {
    ++frames_;
    while (in.more()) {
      const std::uint64_t tag = in.varint();
      if (tag >> 3 == rheonaut_RobotFrame_telemetry_tag) {
        Telemetry batch;
        read_telemetry(in.message(), batch);
        take_samples(who, batch);
      } else if (tag >> 3 == rheonaut_RobotFrame_hello_tag) {
        welcome(who, in.message());
      } else if (tag >> 3 == rheonaut_RobotFrame_command_ack_tag) {
        take_answer(in.message());
      } else {
        in.skip_value(tag & 7);
      }
    }
  }

  void take_samples(std::size_t who, const Telemetry& batch) {
    Robot& robot = robots_[who];
    samples_ += batch.samples;
    robot.heard_next_seq = batch.first_seq + batch.samples;
    if (robot.view != nullptr && !robot.view->pages.empty()) show(robot, batch);
    if (!disk_) return;
    const std::int64_t received_us = utc_us();
    for (std::size_t i = 0; i < batch.samples; ++i) {
      Group* group = robot.group.get();
      if (group == nullptr || group->count == kGroupSamples || !group->head.same_context(batch)) {
        close_group(robot);
        robot.group = disk_->empty_group();
        group = robot.group.get();
        group->robot = who;
        group->head = batch;
        group->head.first_seq += i;
        group->head.first_robot_time_us += i * batch.period_us;
        group->count = 0;
        group->first_received_us = received_us;
        group->began_us = steady_us();
      }
      group->received_us = received_us;
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        std::memcpy(&group->rows[group->count][channel], batch.columns[channel] + i * sizeof(float), sizeof(float));
      }
      ++group->count;
    }
    if (robot.group->count == kGroupSamples) close_group(robot);
  }

  void show(const Robot& robot, const Telemetry& batch) {
    for (std::size_t i = 0; i < batch.samples; ++i) {
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        float value = 0;
        std::memcpy(&value, batch.columns[channel] + i * sizeof(float), sizeof value);
        bare::ViewDesk::add(*robot.view, channel, value);
      }
      views_.sample_is_whole(*robot.view, robot.id, batch.first_seq + i);
    }
  }

  void close_group(Robot& robot) {
    if (robot.group) disk_->add(std::move(robot.group));
  }

  void welcome(std::size_t who, WireReader hello) {
    Robot& robot = robots_[who];
    while (hello.more()) {
      const std::uint64_t tag = hello.varint();
      if (tag >> 3 == rheonaut_Hello_robot_id_tag) {
        const WireReader id = hello.message();
        robot.id.assign(reinterpret_cast<const char*>(id.at()), id.size());
      } else if (tag >> 3 == rheonaut_Hello_boot_id_tag) {
        robot.boot_id = hello.fixed<std::uint64_t>();
      } else {
        hello.skip_value(tag & 7);
      }
    }
    robot.view = views_.view_of(robot.id);
    if (disk_) disk_->add_robot(who, robot);
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome.protocol_version = protocol::kProtocolVersion;
    frame.body.welcome.store_id = 1;
    frame.body.welcome.utc_us = utc_us();
    robot.heartbeat_due_us = steady_us() + kHeartbeatUs;
    send(robot, frame);
  }

  // What is durable goes out at once; a slice of the robots gets its signs of life.
  void sweep(std::int64_t now_us) {
    swept_us_ = now_us;
    views_.stamp(now_us);
    durable_.clear();
    if (disk_) disk_->take_durable(durable_);
    for (const Durable& durable : durable_) {
      robots_[durable.robot].durable_next_seq = durable.next_seq;
      heartbeat(robots_[durable.robot], now_us);
    }
    slice_ = (slice_ + 1) % kSweeps;
    for (std::size_t i = slice_; i < robots_.size(); i += kSweeps) {
      Robot& robot = robots_[i];
      if (robot.fd < 0 || robot.id.empty()) continue;
      if (robot.group && now_us - robot.group->began_us >= kGroupAgeUs + kHeartbeatUs) close_group(robot);
      if (!disk_ && decodes_) robot.durable_next_seq = robot.heard_next_seq;
      if (now_us >= robot.heartbeat_due_us) heartbeat(robot, now_us);
    }
  }

  void heartbeat(Robot& robot, std::int64_t now_us) {
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_heartbeat_tag;
    frame.body.heartbeat.durable_next_seq = robot.durable_next_seq;
    if (now_us >= robot.probe_due_us) {
      frame.body.heartbeat.station_time_us = static_cast<std::uint64_t>(now_us);
      robot.probe_due_us = now_us + kProbeUs;
    }
    robot.heartbeat_due_us = now_us + kHeartbeatUs;
    send(robot, frame);
  }

  static void send(const Robot& robot, const protocol::StationFrame& frame) {
    std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
    const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
    if (robot.fd >= 0) ::send(robot.fd, bytes.data(), size, MSG_NOSIGNAL);
  }

  std::unique_ptr<Disk> disk_;
  bool decodes_;
  int epoll_ = epoll_create1(0);
  int listener_ = bare::listen_on_loopback();
  bare::StopDesk desk_;
  bare::ViewDesk views_;
  std::vector<Robot> robots_;
  std::array<std::uint8_t, 65536> input_{};
  std::vector<Durable> durable_;
  std::int64_t swept_us_ = 0;
  std::size_t slice_ = 0;
  std::uint64_t frames_ = 0, samples_ = 0, bytes_ = 0;
};

}  // namespace

int main(int argc, char** argv) try {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);

  if (argc != 2) throw std::runtime_error{"say DATABASE, --no-disk or --bytes"};
  const std::string what = argv[1];
  const bool keeps = !what.starts_with("--");
  BareLoop loop{keeps ? std::make_unique<Disk>(what) : nullptr, what != "--bytes"};
  std::cout << loop.port() << ' ' << loop.http_port() << std::endl;
  loop.run();
  loop.print_summary();
  return 0;
} catch (const std::exception& error) {
  std::cerr << "bare_loop: " << error.what() << '\n';
  return 1;
}
