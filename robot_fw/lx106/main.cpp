// The replay on the chip's instruction set: the trace to QEMU's standard output, sizes and costs to its standard error.
#include "robot_fw/lx106/replay.hpp"
#include "robot_fw/lx106/simulator.hpp"
#include "robot_fw/lx106/stack_gauge.hpp"

namespace robot_fw::lx106 {
namespace {

class StandardInput final : public RecordingSource {
 public:
  bool read(void* to, std::size_t size) override { return read_exactly(to, size); }
};

// Two instructions a turn, as the clock counts them.
std::uint32_t instructions_of_1000_turns() {
  std::uint32_t turns = 1000;
  const std::uint32_t before = instructions();
  asm volatile("1: addi %0, %0, -1\n bnez %0, 1b" : "+r"(turns));
  return instructions() - before;
}

const char* name_of(RecordKind kind) {
  switch (kind) {
    case RecordKind::tick: return "step";
    case RecordKind::bytes: return "receive";
    case RecordKind::transmit: return "transmit";
    default: return "link";
  }
}

void write_sizes() {
  write_figure("loop_instructions", instructions_of_1000_turns());
  write_figure("robot_bytes", sizeof(Robot));
  write_figure("ring_bytes", sizeof(TelemetryRing));
  write_figure("reader_bytes", sizeof(protocol::FrameReader));
}

// One record: its cost and its stack among the figures, its line in the trace.
[[gnu::noinline]] void play_measured(Replay& replay, const Record& record) {
  static char line[Replay::kMaxLineBytes];
  paint_stack();
  const std::uint32_t before = instructions();
  replay.play(record);
  const std::uint32_t cost = instructions() - before;
  const std::uint32_t stack_bytes = used_stack_bytes();
  write_figure(name_of(record.kind), cost);
  write_figure("stack", stack_bytes);
  if (const std::size_t size = replay.describe(record, line)) write(kOutput, line, size);
}

}  // namespace
}  // namespace robot_fw::lx106

extern "C" int sim_main() {
  using namespace robot_fw::lx106;
  static Replay replay;
  static Record record;
  StandardInput input;
  write_sizes();
  while (read_record(input, record)) play_measured(replay, record);
  return 0;
}
