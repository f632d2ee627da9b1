// The vocabulary of the recording tests: a station's recorder in virtual time, and robots that talk to it.
#pragma once

#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/tasks.hpp"
#include "server/storage/recording_parts.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {

using namespace std::chrono_literals;

inline station::SampleContext manual_at_100_hz() {
  station::SampleContext context;
  context.period_us = 10'000;
  context.mode = rheonaut_MODE_MANUAL;
  return context;
}

inline storage::RunConditions named(std::string name) {
  storage::RunConditions conditions;
  conditions.name = std::move(name);
  return conditions;
}

// A robot that makes a sample every 10 ms; position_m of sample n is n/1000.
struct TestRobot {
  station::RobotId id = "nemo";
  station::BootId boot_id = 0xfedcba9876543210;
  std::uint64_t next_seq = 0;    // the sample made next
  std::uint64_t oldest_seq = 0;  // the oldest still held
  std::uint64_t oldest_event_seq = 0;
  std::uint64_t next_event_seq = 0;
  std::uint64_t acknowledged_next_seq = 0;  // 0: it does not say
  std::uint64_t acknowledged_next_event_seq = 0;
  std::string token;
  bool from_loopback = true;
  station::SampleContext context = manual_at_100_hz();

  std::uint64_t late_us = 0;  // by periods that it skipped
  std::uint32_t controller_checksum = 0xfedcba98;

  std::uint64_t time_of(std::uint64_t seq) const { return 500'000 + late_us + seq * 10'000; }
  station::SampleBatch batch(std::uint64_t first_seq, std::size_t count) const;
};

struct Missing {
  std::uint64_t first_seq = 0;
  std::uint64_t next_seq = 0;
  bool operator==(const Missing&) const = default;
};

class RecordingTest : public ::testing::Test {
 public:
  RecordingTest();
  ~RecordingTest() override;

 protected:
  using Run = server::storage::Run;  // and not testing::Test's

  // A station begins on this folder: opens the database, loads the runs, records.
  void start(storage::RecorderOptions options = {}, const config::RecordingConfig& config = {});
  // SIGTERM: everything received is on disk afterwards.
  void stop();
  // kill -9: what was not committed is gone.
  void kill();

  station::AdmissionRequest hello_of(const TestRobot& robot);
  station::Admission admit(const TestRobot& robot);
  void connect(const TestRobot& robot);  // must be admitted
  void disconnect(const TestRobot& robot);
  // The robot makes samples and the station receives them, `per_frame` at a time.
  void make(TestRobot& robot, std::size_t count, std::size_t per_frame = 5);
  // The same in its own time: a frame per 50 ms.
  void make_slowly(TestRobot& robot, std::size_t count);
  // The station receives samples that were made before.
  void send(const TestRobot& robot, std::uint64_t first_seq, std::size_t count);
  void send(const TestRobot& robot, const station::SampleBatch& batch);
  void flush() { wait(recorder_->flush()); }

  // What the disk holds now.
  std::int64_t number(const std::string& sql);
  std::vector<std::string> rows(const std::string& sql);  // columns joined with '|', NULL is empty

  template <class T>
  T wait(boost::asio::awaitable<T> work) {
    std::optional<T> value;
    std::exception_ptr failure;
    boost::asio::co_spawn(loop_, std::move(work), [&](std::exception_ptr error, T result) {
      failure = error;
      if (!error) value.emplace(std::move(result));
    });
    finish(value, failure);
    return std::move(*value);
  }
  void wait(boost::asio::awaitable<void> work) {
    std::optional<bool> value;
    std::exception_ptr failure;
    boost::asio::co_spawn(loop_, std::move(work), [&](std::exception_ptr error) {
      failure = error;
      value.emplace(true);
    });
    finish(value, failure);
  }
  template <class T>
  void finish(std::optional<T>& value, std::exception_ptr& failure) {
    const bool ended = clock_.run_until([&] { return value || failure; }, 60s);
    if (failure) std::rethrow_exception(failure);
    if (!ended) throw std::runtime_error{"did not end within 60 s"};
  }

  station::RobotState state_of(const TestRobot& robot, station::LinkState link) const;

  std::filesystem::path folder_;
  std::filesystem::path path_;
  std::uint32_t most_robots_ = 100'000;  // that may enrol themselves, in all and in a minute
  std::uint32_t most_a_minute_ = 100'000;
  boost::asio::io_context loop_{1};
  runtime::WorkerThread disk_{"disk"};
  runtime::WorkerThread readers_{"readers"};
  runtime::WorkerThread checkpoints_{"checkpoints"};
  runtime::WorkerThread exports_worker_{"exports"};
  VirtualClock clock_{loop_};
  std::unique_ptr<runtime::TaskGroup> tasks_;
  std::unique_ptr<storage::RecordingParts> recording_;
  storage::Recorder* recorder_ = nullptr;  // of recording_, as are the next two
  storage::Runs* runs_ = nullptr;
  storage::History* history_ = nullptr;
  storage::RestoredState restored_;
  std::map<station::RobotId, station::BootId> latest_boots_;
  std::uint64_t durable_next_seq_ = 0;  // as sent last, of a robot's latest boot
  std::map<station::BootId, std::uint64_t> durable_next_seqs_;
  std::uint64_t durable_next_event_seq_ = 0;
  std::vector<Missing> missing_;  // as asked for
  int missing_events_ = 0;        // times that they were asked for
};

}  // namespace server
