// A pass over the write-ahead log that is under way delays no commit, until the log has grown by half again.
#include "tests/server/recording/forgetful_vfs.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

constexpr std::uint64_t kCheckpointBytes = 1 << 20;

// The pass stands still at its first write to the database. Nobody else writes there: commits write to the log.
class HeldCheckpointTest : public RecordingTest {
 protected:
  void SetUp() override {
    storage::RecorderOptions options;
    options.checkpoint_bytes = kCheckpointBytes;
    start(options);
    connect(robot_);
    clock_.run_for(1s);
    passes_ = recorder_->wal().checkpoints;  // of the start
    clock_.remove_worker(checkpoints_);      // time goes on beside a pass
    vfs_.hold_database_writes();
    for (int i = 0; i < 30 && recorder_->wal().bytes < kCheckpointBytes; ++i) make_some();
    ASSERT_TRUE(vfs_.await_held_write(2min));
  }
  void TearDown() override {
    if (!was_let_go_) let_go();
    kill();  // before the VFS is gone
  }

  void let_go() {
    was_let_go_ = true;
    vfs_.let_go();
    clock_.add_worker(checkpoints_);
  }

  // About 70 kB of log.
  void make_some() {
    make(robot_, 1000, 500);
    clock_.run_for(100ms);
  }

  ForgetfulVfs vfs_;
  TestRobot robot_;
  bool was_let_go_ = false;
  std::uint64_t passes_ = 0;
};

TEST_F(HeldCheckpointTest, CommitsGoOnBesideIt) {
  for (int i = 0; i < 4; ++i) {
    make_some();
    EXPECT_EQ(durable_next_seq_, robot_.next_seq);
  }
  EXPECT_EQ(recorder_->wal().checkpoints, passes_);
  EXPECT_LT(recorder_->wal().bytes, kCheckpointBytes * 3 / 2);
}

TEST_F(HeldCheckpointTest, ALogThatHasGrownByHalfWaitsForItAndLosesNothing) {
  for (int i = 0; i < 60; ++i) make_some();
  EXPECT_LT(recorder_->wal().bytes, kCheckpointBytes * 3 / 2 + 100'000) << "and one commit";
  EXPECT_LT(durable_next_seq_, robot_.next_seq);
  EXPECT_EQ(recorder_->queued_samples(), robot_.next_seq - durable_next_seq_);
  EXPECT_EQ(recorder_->wal().checkpoints, passes_);
  let_go();
  clock_.run_for(3s);
  EXPECT_EQ(durable_next_seq_, robot_.next_seq);
  make_some();
  EXPECT_GT(recorder_->wal().checkpoints, passes_);
  EXPECT_LT(recorder_->wal().bytes, kCheckpointBytes) << "it began anew";
  EXPECT_EQ(number("SELECT count(*) FROM sample"), static_cast<std::int64_t>(robot_.next_seq));
}

}  // namespace
}  // namespace server
