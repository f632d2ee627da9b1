// The least that can record robots and stop them: the yardstick of tests/bench/recording_bench and
// tests/bench/stop_bench.
//
//   bare_loop DATABASE         receives, and stores as the station does: the same tables, rows, settings and durability
//   bare_loop --no-disk        receives and acknowledges, stores nothing
//   bare_loop --bytes          reads and throws away: what the kernel alone costs
//
// With --real-time behind it, its threads have the priorities of the station's.
//
// One thread reads the robots' sockets that are ready, every 2 ms while they talk, as the station does; it decodes
// frames where they lie and fills groups of 100 samples, and allocates nothing per frame. The socket of a robot that is
// to answer a stop, and everything else, is read at once. A second thread writes the full groups (bare_disk.hpp) and
// says what is durable. Each robot gets the acknowledgements, signs of life and clock probes that the station sends.
//
// A request on its HTTP port, whatever it says, is a stop of the robot that it names between the fourth slash and the
// fifth: the frame is sent in the same turn, and the robot's answer is the answer. Pages get samples and stamps there,
// as on the station's /live.
//
// It believes everything: no checks of values, no gaps, no duplicates, no reconnects, no other commands, no second
// robot of a name, no full queue, no failing disk, no record of a stop. Prints its ports, robots' and HTTP; ends when
// its input does, with a line of JSON.
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "protocol/frame.hpp"
#include "server/runtime/real_time.hpp"
#include "tests/bench/bare_disk.hpp"
#include "tests/bench/bare_groups.hpp"
#include "tests/bench/bare_stops.hpp"
#include "tests/bench/bare_views.hpp"
#include "tests/bench/bare_wire.hpp"

namespace {

using bare::Durable;
using bare::Group;
using bare::kChannels;
using bare::kGroupSamples;
using bare::steady_us;
using bare::Telemetry;
using bare::utc_us;
using bare::WireReader;

constexpr std::int64_t kHeartbeatUs = 200'000, kProbeUs = 1'000'000, kGroupAgeUs = 1'000'000;

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

class BareLoop {
 public:
  BareLoop(std::unique_ptr<bare::Disk> disk, bool decodes) : disk_{std::move(disk)}, decodes_{decodes} {
    robots_.reserve(30'000);
    watch(epoll_, listener_, kListener);
    watch(epoll_, desk_.listener(), kHttpListener);
    watch(epoll_, STDIN_FILENO, kInput);
  }

  std::uint16_t port() const { return bare::port_of(listener_); }
  std::uint16_t http_port() const { return bare::port_of(desk_.listener()); }

  void run() {
    std::array<epoll_event, 256> ready{};
    for (;;) {
      const std::int64_t wait_us = is_quiet_ ? 10'000 : std::max<std::int64_t>(next_look_us_ - steady_us(), 0);
      const timespec wait{0, wait_us * 1000};
      const int count = epoll_pwait2(epoll_, ready.data(), static_cast<int>(ready.size()), &wait, nullptr);
      for (int i = 0; i < count; ++i) {
        const std::uint64_t who = ready[static_cast<std::size_t>(i)].data.u64;
        if (who == kInput) return;
        take(who);
      }
      const std::int64_t now_us = steady_us();
      if (!is_quiet_ && now_us >= next_look_us_) read_robots();
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
  static constexpr std::uint64_t kAllRobots = kListener - 3;
  static constexpr std::int64_t kPauseUs = 2000;  // from one look at all robots to the next
  static constexpr int kQuietLooks = 5;           // with one ready at most
  static constexpr std::size_t kSweeps = 20;      // slices of robots, one each 10 ms

  static void watch(int epoll, int fd, std::uint64_t who) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = who;
    epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event);
  }

  void take(std::uint64_t who) {
    if (who == kListener) {
      accept_all();
    } else if (who == kHttpListener) {
      const int fd = desk_.accept_asker();
      if (fd >= 0) watch(epoll_, fd, kFirstAsker + static_cast<std::uint64_t>(fd));
    } else if (who == kAllRobots) {
      read_robots();
    } else if (who >= kFirstAsker) {
      take_request(static_cast<int>(who - kFirstAsker));
    } else {
      read(who);
    }
  }

  // As the station's PollSet: every 2 ms, and when hardly anybody speaks as soon as something comes.
  void read_robots() {
    std::array<epoll_event, 256> ready{};
    std::size_t read_now = 0;
    for (int count = static_cast<int>(ready.size()); count == static_cast<int>(ready.size());) {
      count = epoll_wait(robots_epoll_, ready.data(), static_cast<int>(ready.size()), 0);
      for (int i = 0; i < count; ++i) read(ready[static_cast<std::size_t>(i)].data.u64);
      read_now += static_cast<std::size_t>(std::max(count, 0));
    }
    next_look_us_ = steady_us() + kPauseUs;
    quiet_looks_ = read_now <= 1 ? quiet_looks_ + 1 : 0;
    const bool is_quiet = quiet_looks_ >= kQuietLooks;
    if (is_quiet == is_quiet_) return;
    is_quiet_ = is_quiet;
    if (is_quiet_) watch(epoll_, robots_epoll_, kAllRobots);
    if (!is_quiet_) epoll_ctl(epoll_, EPOLL_CTL_DEL, robots_epoll_, nullptr);
  }

  void accept_all() {
    for (int fd; (fd = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK)) >= 0;) {
      const int on = 1;
      setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      Robot& robot = robots_.emplace_back();
      robot.fd = fd;
      watch(robots_epoll_, fd, robots_.size() - 1);
    }
  }

  void take_request(int fd) {
    const std::string_view text = desk_.read(fd);
    if (text.empty() || views_.take(fd, text)) return;
    const auto robot =
        std::find_if(robots_.begin(), robots_.end(),
                     [id = bare::StopDesk::robot_of(text)](const Robot& one) { return one.fd >= 0 && one.id == id; });
    if (robot == robots_.end()) return bare::StopDesk::answer(fd, "404 Not Found");
    protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
    frame.which_body = rheonaut_StationFrame_command_tag;
    frame.body.command.command_id = desk_.new_stop(fd);
    frame.body.command.which_action = rheonaut_Command_emergency_stop_tag;
    send(*robot, frame);
    watch(epoll_, robot->fd, static_cast<std::uint64_t>(robot - robots_.begin()));  // until it has answered
  }

  void take_answer(const Robot& robot, WireReader ack) {
    while (ack.more()) {
      const std::uint64_t tag = ack.varint();
      if (tag >> 3 == rheonaut_CommandAck_command_id_tag) {
        epoll_ctl(epoll_, EPOLL_CTL_DEL, robot.fd, nullptr);
        return desk_.answer_stop(ack.fixed<std::uint64_t>());
      }
      ack.skip_value(tag & 7);
    }
  }

  void read(std::uint64_t who) {
    Robot& robot = robots_[who];
    std::memcpy(input_.data(), robot.rest.data(), robot.rest_size);
    const ssize_t got = recv(robot.fd, input_.data() + robot.rest_size, input_.size() - robot.rest_size, 0);
    if (got < 0 && errno == EAGAIN) return;  // the other set had it already
    if (got <= 0) {
      close(std::exchange(robot.fd, -1));  // which takes it out of both sets
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
        bare::read_telemetry(in.message(), batch);
        take_samples(who, batch);
      } else if (tag >> 3 == rheonaut_RobotFrame_hello_tag) {
        welcome(who, in.message());
      } else if (tag >> 3 == rheonaut_RobotFrame_command_ack_tag) {
        take_answer(robots_[who], in.message());
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
    if (disk_) disk_->add_robot(who, robot.id, robot.boot_id);
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

  std::unique_ptr<bare::Disk> disk_;
  bool decodes_;
  int epoll_ = epoll_create1(0);         // of everything that is read at once
  int robots_epoll_ = epoll_create1(0);  // of the robots
  bool is_quiet_ = false;                // robots_epoll_ is in epoll_
  int quiet_looks_ = 0;
  std::int64_t next_look_us_ = 0;
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

  const bool in_real_time = argc == 3 && argv[2] == std::string{"--real-time"};
  if (argc != 2 && !in_real_time) throw std::runtime_error{"say DATABASE, --no-disk or --bytes [--real-time]"};
  const std::string what = argv[1];
  const bool keeps = !what.starts_with("--");
  BareLoop loop{keeps ? std::make_unique<bare::Disk>(what, in_real_time) : nullptr, what != "--bytes"};
  if (in_real_time && !server::runtime::set_priority(server::runtime::Priority::loop))
    throw std::runtime_error{"no real-time priority"};
  std::cout << loop.port() << ' ' << loop.http_port() << std::endl;
  loop.run();
  loop.print_summary();
  return 0;
} catch (const std::exception& error) {
  std::cerr << "bare_loop: " << error.what() << '\n';
  return 1;
}
