// The program that writes export files, as the station follows it: scripts that break stand in for it here.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <boost/asio/co_spawn.hpp>
#include <fstream>
#include <stdexcept>

#include "server/runtime/tasks.hpp"
#include "server/storage/export/export_child.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;

TEST(ExportLines, EachLineIsReadBackAsItWasWritten) {
  const storage::ExportLine lines[] = {storage::ExportProgress{12, 100}, storage::ExportDone{},
                                       Error{ErrorCode::unavailable, "no room: 3 MB are free", "low_space"},
                                       Error{ErrorCode::not_found, "no run 9", ""}};
  for (const storage::ExportLine& line : lines) {
    std::string text = storage::line_text(line);
    ASSERT_TRUE(text.ends_with('\n'));
    text.pop_back();
    const auto read = storage::parse_export_line(text);
    ASSERT_TRUE(read.has_value()) << text;
    EXPECT_EQ(storage::line_text(*read), text + "\n");
  }
  EXPECT_EQ(storage::line_text(Error{ErrorCode::internal, "two\nlines", ""}), "failed internal - two lines\n");
  EXPECT_LE(storage::line_text(Error{ErrorCode::internal, std::string(100'000, 'x'), ""}).size(),
            storage::kMaxLineBytes + 1);
}

TEST(ExportLines, WhatIsNoLineIsRefused) {
  for (const char* text : {"", "progress", "progress 1", "progress 2 1", "progress -1 5", "progress 1 2 3", "done now",
                           "failed", "failed internal", "failed internal -", "failed nothing - x", "hello"}) {
    EXPECT_FALSE(storage::parse_export_line(text).has_value()) << text;
  }
}

TEST(ExportOrder, IsReadBackFromItsArguments) {
  storage::ExportOrder order{"/a b/station.sqlite", storage::ExportFormat::mat, {}, "/tmp/x y.mat"};
  order.query.run = 7;
  order.query.grid_us = 1000;
  order.query.channels = storage::parse_channels("duty,position_m").value();
  const auto read = storage::parse_export_arguments(export_arguments(order, 12));
  ASSERT_TRUE(read.has_value()) << read.error().detail;
  EXPECT_EQ(read->parent, 12);
  EXPECT_EQ(export_arguments(read->order, 12), export_arguments(order, 12));
  EXPECT_EQ(read->order.query.grid_us, 1000);
  EXPECT_EQ(read->order.query.channels.count(), 2u);
  EXPECT_FALSE(storage::parse_export_arguments({}).has_value());
  EXPECT_FALSE(storage::parse_export_arguments({"a", "x", "mat", "b", "-", "0", "1"}).has_value());
  EXPECT_FALSE(storage::parse_export_arguments({"a", "1", "doc", "b", "-", "0", "1"}).has_value());
}

class ExportChildTest : public ::testing::Test {
 protected:
  ExportChildTest() {
    std::string name = "/tmp/rheonaut-child-XXXXXX";
    folder_ = mkdtemp(name.data());
  }
  ~ExportChildTest() override { std::filesystem::remove_all(folder_); }

  // A program that does this.
  storage::ExportLimits script(const std::string& text, std::chrono::milliseconds most_silent = 2min) {
    const std::filesystem::path path = folder_ / "program";
    std::ofstream{path} << "#!/bin/sh\n" << text << '\n';
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return {path, most_silent};
  }
  storage::ExportOrder order() const {
    storage::ExportOrder order{folder_ / "station.sqlite", storage::ExportFormat::mat, {}, folder_ / "out.mat"};
    order.query.run = 1;
    return order;
  }
  // To its end.
  static Result<bool> follow(storage::ExportChild& child) {
    for (;;) {
      const Result<bool> more = child.advance();
      if (!more || !*more) return more;
    }
  }
  Error error_of(const storage::ExportLimits& limits) {
    storage::ExportChild child{order(), limits};
    const Result<bool> end = follow(child);
    EXPECT_FALSE(end.has_value());
    return end ? Error{} : end.error();
  }
  static bool has_children() { return ::waitpid(-1, nullptr, WNOHANG) != -1; }

  std::filesystem::path folder_;
};

TEST_F(ExportChildTest, ItsProgressAndItsEndAreFollowed) {
  {
    storage::ExportChild child{order(), script("echo progress 5 10; echo done")};
    EXPECT_FALSE(follow(child).value());
    EXPECT_DOUBLE_EQ(child.progress().share(), 1);
  }
  EXPECT_FALSE(has_children());
}

TEST_F(ExportChildTest, ItsErrorIsPassedOn) {
  const Error error = error_of(script("echo failed not_found no_run there is no run 1; exit 1"));
  EXPECT_EQ(error.code, ErrorCode::not_found);
  EXPECT_EQ(error.reason, "no_run");
  EXPECT_EQ(error.detail, "there is no run 1");
}

TEST_F(ExportChildTest, OneThatBreaksOffIsAnErrorThatSaysHow) {
  const std::pair<const char*, const char*> programs[] = {{"kill -9 $$", "signal 9 (Killed)"},
                                                          {"echo progress 1 2; kill -SEGV $$", "signal 11"},
                                                          {"exit 3", "status 3"},
                                                          {"exit 0", "status 0"},
                                                          {"echo hello; exec sleep 600", "no line of its protocol"},
                                                          {"yes | tr -d '\\n'", "no line of its protocol"}};
  for (const auto& [text, how] : programs) {
    SCOPED_TRACE(text);
    const Error error = error_of(script(text));
    EXPECT_EQ(error.code, ErrorCode::unavailable);
    EXPECT_EQ(error.reason, "export_program");
    EXPECT_NE(error.detail.find(how), std::string::npos) << error.detail;
    EXPECT_FALSE(has_children());
  }
}

TEST_F(ExportChildTest, OneThatIsNotThereOrNoProgramIsAnError) {
  std::ofstream{folder_ / "text"} << "no program";
  for (const char* name : {"none", "text"}) {
    const Error error = error_of({folder_ / name, 2min});
    EXPECT_EQ(error.reason, "export_program");
    EXPECT_NE(error.detail.find("cannot be started"), std::string::npos) << error.detail;
    EXPECT_NE(error.detail.find(name), std::string::npos) << error.detail;
  }
  EXPECT_FALSE(has_children());
}

TEST_F(ExportChildTest, OneThatHangsIsEnded) {
  for (const char* text : {"exec sleep 600", "echo progress 1 2; kill -STOP $$", "exec <&- >&- 2>&-; exec sleep 600"}) {
    SCOPED_TRACE(text);
    const Error error = error_of(script(text, 300ms));
    EXPECT_EQ(error.code, ErrorCode::unavailable);
    EXPECT_FALSE(has_children());
  }
  EXPECT_EQ(error_of(script("exec sleep 600", 300ms)).reason, "export_stalled");
}

TEST_F(ExportChildTest, ItEndsWithTheObjectThatFollowsIt) {
  {
    storage::ExportChild child{order(), script("echo progress 1 2; exec sleep 600")};
    while (child.progress().total == 0) ASSERT_TRUE(child.advance().value());
    EXPECT_TRUE(has_children());
  }
  EXPECT_FALSE(has_children());
}

// Keeps a child of this program from being reaped after its death, as the kernel does while a disk does not answer: it
// traces it.
class SlowDeath {
 public:
  explicit SlowDeath(pid_t victim) {
    int ends[2];
    if (::pipe(ends) != 0) throw std::runtime_error{"no pipe"};
    tracer_ = ::fork();
    if (tracer_ == 0) {
      const char is_traced = ::ptrace(PTRACE_SEIZE, victim, nullptr, nullptr) == 0 ? 1 : 0;
      if (::write(ends[1], &is_traced, 1) != 1) ::_exit(1);
      for (;;) ::pause();
    }
    char is_traced = 0;
    if (::read(ends[0], &is_traced, 1) != 1 || is_traced == 0) {
      over();
      throw std::runtime_error{"this machine lets no program trace another of its user (kernel.yama.ptrace_scope)"};
    }
    ::close(ends[0]), ::close(ends[1]);
  }
  ~SlowDeath() { over(); }
  SlowDeath(const SlowDeath&) = delete;
  SlowDeath& operator=(const SlowDeath&) = delete;

  void over() {
    if (tracer_ < 0) return;
    ::kill(tracer_, SIGKILL);
    ::waitpid(tracer_, nullptr, 0);
    tracer_ = -1;
  }

 private:
  pid_t tracer_ = -1;
};

// SAFETY: no thread waits for such a program for longer than a slice, and it is reaped however late it dies.
TEST_F(ExportChildTest, OneThatDiesLateBlocksNoThreadAndIsReaped) {
  boost::asio::io_context loop;
  runtime::WorkerThread worker{"exports"};
  storage::DatabaseReader reader{folder_ / "station.sqlite", worker};
  auto child = std::make_shared<storage::ExportChild>(order(), script("echo progress $$ $$; exec sleep 600"));
  pid_t pid = 0;
  auto start = [&] {
    for (; pid == 0; pid = static_cast<pid_t>(child->progress().total)) child->advance().value();
    return true;
  };
  ASSERT_TRUE(runtime::run_first(loop, reader.run(start)));
  SlowDeath death{pid};
  int slices_of_others = 0;
  bool has_ended = false;
  boost::asio::co_spawn(loop, storage::end_export(reader, std::move(child)),
                        [&](const std::exception_ptr&) { has_ended = true; });
  auto nothing = [] { return true; };
  const auto look = [&](const auto& again, int most) -> void {
    boost::asio::co_spawn(loop, reader.run(nothing), [&, most](const std::exception_ptr&, bool) {
      ++slices_of_others;
      if (most > 1) again(again, most - 1);
    });
  };
  look(look, 300);  // of 10 ms each: longer than any wait for its death that would block
  while (slices_of_others < 300) ASSERT_GT(loop.run_one_for(2min), 0u);
  EXPECT_FALSE(has_ended);
  siginfo_t found{};
  EXPECT_EQ(::waitid(P_PID, static_cast<id_t>(pid), &found, WEXITED | WNOHANG | WNOWAIT), 0) << "it is still there";
  death.over();
  while (!has_ended) ASSERT_GT(loop.run_one_for(2min), 0u);
  EXPECT_FALSE(has_children());
}

// No socket of the station's stays open in it; signals that the station ignores or blocks, and the scheduling of its
// threads, are as usual there.
TEST_F(ExportChildTest, ItInheritsNothing) {
  const int open = ::open("/dev/null", O_RDONLY);
  ASSERT_EQ(::dup2(open, 57), 57);  // not closed by exec
  const auto pipe_before = ::signal(SIGPIPE, SIG_IGN);
  sigset_t blocked{}, before{};
  ::sigemptyset(&blocked), ::sigaddset(&blocked, SIGUSR1);
  ::pthread_sigmask(SIG_BLOCK, &blocked, &before);
  const sched_param usual{};
  ASSERT_EQ(::sched_setscheduler(0, SCHED_BATCH, &usual), 0);
  const auto file = folder_ / "seen";
  storage::ExportChild child{
      order(), script("ls /proc/self/fd > " + file.string() + "; grep Sig /proc/self/status >> " + file.string() +
                      "; awk '{print \"policy\", $41}' /proc/self/stat >> " + file.string() +
                      "; readlink /proc/self/fd/0 >> " + file.string() + "; echo done")};
  EXPECT_FALSE(follow(child).value());
  ::sched_setscheduler(0, SCHED_OTHER, &usual);
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  ::signal(SIGPIPE, pipe_before);
  ::close(57), ::close(open);
  std::ifstream in{file};
  const std::string seen{std::istreambuf_iterator<char>{in}, {}};
  EXPECT_EQ(("\n" + seen).find("\n57\n"), std::string::npos) << seen;
  for (const auto& [name, signal] : {std::pair{"SigIgn:", SIGPIPE}, std::pair{"SigBlk:", SIGUSR1}}) {
    const std::size_t set = seen.find(name);
    ASSERT_NE(set, std::string::npos) << seen;
    EXPECT_EQ(std::stoull(seen.substr(set + 7), nullptr, 16) >> (signal - 1) & 1, 0u) << seen;
  }
  EXPECT_NE(seen.find("policy 0\n"), std::string::npos) << seen;
  EXPECT_NE(seen.find("/dev/null"), std::string::npos) << seen;
}

}  // namespace
}  // namespace server
