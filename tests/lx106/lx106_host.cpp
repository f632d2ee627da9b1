// The host's half of the comparison with the chip's instruction set.
//
//   lx106_host record FILE     plays a session with a simulated plant and station, and records what went into the core
//   lx106_host replay FILE     plays that file to a core; the trace goes to standard output
//   lx106_host trials [BLOCK]  the checksums of the float trials, or one block of them in detail
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "robot_fw/lx106/float_trials.hpp"
#include "robot_fw/lx106/replay.hpp"
#include "tests/lx106/recorded_session.hpp"

namespace {

using namespace robot_fw::lx106;

class FileSource final : public RecordingSource {
 public:
  explicit FileSource(const std::string& path) : file_(path, std::ios::binary) {}
  bool read(void* to, std::size_t size) override {
    file_.read(static_cast<char*>(to), static_cast<std::streamsize>(size));
    return file_.good();
  }

 private:
  std::ifstream file_;
};

// What is written must be there: an output that ends early would compare well with another one.
int written() {
  std::cout.flush();
  if (std::cout.good()) return EXIT_SUCCESS;
  std::cerr << "lx106_host: standard output takes no more\n";
  return EXIT_FAILURE;
}

int replay(const std::string& path) {
  FileSource file(path);
  Replay replay;
  Record record;
  static char line[Replay::kMaxLineBytes];
  while (read_record(file, record)) {
    replay.play(record);
    std::cout.write(line, static_cast<std::streamsize>(replay.describe(record, line)));
  }
  return written();
}

int trials() {
  static char line[kMaxTrialLineBytes];
  for (std::uint32_t block = 0; block < kFloatBlocks; ++block) {
    std::cout.write(line, static_cast<std::streamsize>(describe_block(block, line)));
  }
  return written();
}

int trials_in_detail(std::uint32_t block) {
  static char line[kMaxTrialLineBytes];
  FloatPairs pairs(block);
  for (std::uint32_t i = 0; i < kPairsPerBlock; ++i) {
    const FloatPair pair = pairs.next();
    for (std::size_t j = 0; j < kFloatOperations; ++j) {
      std::cout.write(line, static_cast<std::streamsize>(describe_pair(static_cast<FloatOperation>(j), pair, line)));
    }
  }
  return written();
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() == 2 && arguments[0] == "record") return record_session(arguments[1]);
  if (arguments.size() == 2 && arguments[0] == "replay") return replay(arguments[1]);
  if (arguments.size() == 1 && arguments[0] == "trials") return trials();
  if (arguments.size() == 2 && arguments[0] == "trials") {
    return trials_in_detail(static_cast<std::uint32_t>(std::stoul(arguments[1])));
  }
  std::cerr << "usage: lx106_host record FILE | replay FILE | trials [BLOCK]\n";
  return EXIT_FAILURE;
}
