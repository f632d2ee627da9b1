// Options, standard input and signals of the proxy.
#include "sim_robot/cli/proxy_command.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <csignal>
#include <iostream>
#include <sstream>
#include <stdexcept>

#include "sim_robot/proxy/proxy.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr std::size_t kMaxLineBytes = 4096;

tcp::endpoint parse_listen(const std::string& text) {
  const StationAddress address = parse_station_address(text, "--listen", 0);
  boost::system::error_code error;
  const auto ip = asio::ip::make_address(address.host == "localhost" ? "127.0.0.1" : address.host, error);
  if (error) throw std::invalid_argument("--listen: '" + address.host + "' is not an IP address");
  return {ip, static_cast<std::uint16_t>(std::stoi(address.port))};
}

Outage parse_outage(const std::string& text) {
  std::istringstream stream{text};
  Outage outage;
  char comma = 0;
  stream >> outage.at_s >> comma >> outage.for_s;
  const bool good = stream && stream.peek() == EOF && comma == ',' && outage.at_s >= 0 && outage.for_s >= 0;
  if (!good) throw std::invalid_argument("--outage: '" + text + "' is not AT,FOR in seconds, such as 10,5");
  return outage;
}

// Opened anew where that is possible: a terminal must not be left non-blocking for the shell.
asio::posix::stream_descriptor standard_input(asio::io_context& loop) {
  const int opened = open("/dev/stdin", O_RDONLY | O_CLOEXEC);
  return asio::posix::stream_descriptor{loop, opened >= 0 ? opened : dup(STDIN_FILENO)};
}

// Until the input ends; the proxy goes on without it.
asio::awaitable<void> obey(Proxy& proxy, asio::posix::stream_descriptor& input, LinkLog log) {
  std::string waiting;
  for (;;) {
    auto buffer = asio::dynamic_buffer(waiting, kMaxLineBytes);
    const auto [error, size] =
        co_await asio::async_read_until(input, buffer, '\n', asio::as_tuple(asio::use_awaitable));
    if (error) co_return;
    log(proxy.control(waiting.substr(0, size)));
    waiting.erase(0, size);
  }
}

}  // namespace

ProxyCommand::ProxyCommand(CLI::App& app)
    : command_(app.add_subcommand("proxy", "a bad network: passes TCP connections on, with faults")) {
  impairment_.buffer_bytes = 65'536;
  command_->add_option("--listen", listen_, "ADDR:PORT, port 0 for a free one")->capture_default_str();
  command_->add_option("--to", target_, "ADDR:PORT of the target")->required();
  command_->add_option("--delay-ms", delay_ms_, "each way")->capture_default_str();
  command_->add_option("--jitter-ms", jitter_ms_, "at most so much more")->capture_default_str();
  command_->add_option("--throttle-bytes-per-s", impairment_.bytes_per_s, "0: no throttle")->capture_default_str();
  command_->add_option("--loss", impairment_.loss_probability, "of a segment, in [0, 0.99]")->capture_default_str();
  command_->add_option("--split", impairment_.split_bytes, "at most so many bytes a write; 0: no limit")
      ->capture_default_str();
  command_->add_option("--buffer-bytes", impairment_.buffer_bytes, "what each direction holds")->capture_default_str();
  command_->add_option("--outage", outages_, "AT,FOR seconds after the start; more than one may be given");
  command_->add_option("--seed", seed_, "of jitter and loss")->capture_default_str();
  command_->footer(
      "Standard input, a line each: cut [BYTES] | reset | half-open [up|down|both] | outage SECONDS [reset] | heal |\n"
      "delay MS | jitter MS | throttle BYTES_PER_S | loss PROBABILITY | split BYTES");
}

int ProxyCommand::run() const {
  ProxyOptions options;
  options.listen = parse_listen(listen_);
  options.target = parse_station_address(target_, "--to");
  options.impairment = impairment_;
  options.impairment.delay_s = 1e-3 * delay_ms_;
  options.impairment.jitter_s = 1e-3 * jitter_ms_;
  for (const std::string& outage : outages_) options.outages.push_back(parse_outage(outage));
  options.seed = seed_;

  asio::io_context loop{1};
  const LinkLog log = [](const std::string& line) { std::cout << line << std::endl; };
  Proxy proxy{loop, options, log};
  auto input = standard_input(loop);
  const auto on_end = [](const std::exception_ptr& error) {
    if (error) std::rethrow_exception(error);
  };
  asio::co_spawn(loop, proxy.run(), on_end);
  asio::co_spawn(loop, obey(proxy, input, log), on_end);
  asio::signal_set stop{loop, SIGINT, SIGTERM};
  stop.async_wait([&](const boost::system::error_code&, int) {
    proxy.stop();
    boost::system::error_code ignored;
    input.close(ignored);
  });
  loop.run();
  return EXIT_SUCCESS;
}

}  // namespace sim_robot
