// A station that keeps nothing, as a program: prints its port, acknowledges what it gets, ends when its input does.
#include <sys/resource.h>
#include <unistd.h>

#include <boost/asio/posix/stream_descriptor.hpp>
#include <iostream>

#include "tests/sim_robot/telemetry_sink.hpp"

int main(int argc, char** argv) {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);

  boost::asio::io_context loop{1};
  sim_robot::TelemetrySink sink{loop, static_cast<std::uint16_t>(argc > 1 ? std::stoi(argv[1]) : 0)};
  std::cout << sink.port() << std::endl;
  boost::asio::posix::stream_descriptor input{loop, dup(STDIN_FILENO)};
  input.async_wait(boost::asio::posix::stream_descriptor::wait_read,
                   [&loop](const boost::system::error_code&) { loop.stop(); });
  loop.run();
  std::uint64_t missing = 0, repeated = 0;
  for (const auto& [id, boot] : sink.boots()) {
    missing += boot.missing;
    repeated += boot.repeated;
  }
  std::cout << "{\"boots\":" << sink.boots().size() << ",\"frames\":" << sink.frames()
            << ",\"samples\":" << sink.samples() << ",\"missing\":" << missing << ",\"repeated\":" << repeated << "}"
            << std::endl;
}
