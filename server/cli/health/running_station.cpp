// Asks /healthz over a plain socket with a time limit first, so that a station that hangs does not hang the doctor.
#include "server/cli/health/running_station.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

#include "base/version.hpp"
#include "base/whole_file.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/health/listening_program.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/config/endpoint.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::cli {
namespace {

using boost::asio::ip::tcp;

constexpr timeval kPatience{5, 0};

tcp::endpoint reachable(const std::string& address) {
  tcp::endpoint endpoint = config::parse_endpoint(address);
  if (endpoint.address().is_unspecified()) endpoint.address(boost::asio::ip::address_v4::loopback());
  return endpoint;
}

// A port that speaks TLS answers these plain bytes, too, if its loop runs: with 400.
bool answers_within_patience(const std::string& address) {
  try {
    boost::asio::io_context loop;
    tcp::socket socket{loop};
    const tcp::endpoint endpoint = reachable(address);
    socket.open(endpoint.protocol());
    setsockopt(socket.native_handle(), SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
    setsockopt(socket.native_handle(), SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
    socket.connect(endpoint);
    const std::string request = "GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    if (::send(socket.native_handle(), request.data(), request.size(), MSG_NOSIGNAL) < 0) return false;
    char first = 0;
    return ::recv(socket.native_handle(), &first, 1, 0) == 1;
  } catch (const std::exception&) {  // nobody listens, or it is no address
    return false;
  }
}

void read_announcement(const std::filesystem::path& file, RunningStation& running) {
  constexpr std::size_t kMaxBytes = 64 * 1024;
  const base::WholeFile whole = base::read_whole(file, kMaxBytes);
  running.has_announcement = whole.problem.empty();
  const auto content = nlohmann::json::parse(whole.text, nullptr, false);
  if (!content.is_object()) return;
  running.http = content.value("http", "");
  running.robots = content.value("robots", "");
  running.pid = content.value("pid", 0);
}

void ask(const std::filesystem::path& data_dir, RunningStation& running) {
  try {
    const StationClient client{data_dir};
    const auto answer_to = [&client](const char* target) {
      return asked(client.ask("GET", target, nullptr, {std::chrono::seconds{kPatience.tv_sec}}));
    };
    running.station = answer_to("/api/v1/station");
    running.recording = answer_to("/api/v1/recording");
    running.robot_list = answer_to("/api/v1/robots");
  } catch (const std::exception& error) {  // not our token, or it has just ended
    running.problem = runtime::text_of(error);
  }
}

std::string named_program(const tcp::endpoint& endpoint) {
  const std::optional<ListeningProgram> program = find_listening_program(endpoint);
  if (!program) return "";
  return program->pid == 0 ? "a program of another user" : fmt::format("{} (pid {})", program->name, program->pid);
}

void check_port(const std::string& what, const std::string& address, bool runs, bool or_any_port, Findings& findings) {
  const tcp::endpoint endpoint = config::parse_endpoint(address);
  const int port = endpoint.port();
  const std::string topic = what + " port";
  const std::string program = port == 0 ? "" : named_program(endpoint);
  if (port == 0) return findings.fine(topic, fmt::format("{}: any free port is taken at the start", address));
  if (runs && program.empty()) {
    return findings.problem(topic, fmt::format("nothing listens on {}, which the station has announced", address),
                            "restart the station; its log says why it cannot listen");
  }
  if (runs) return findings.fine(topic, fmt::format("{} listens on {}", program, address));
  if (program.empty()) return findings.fine(topic, fmt::format("{} is free", address));
  const std::string taken = fmt::format("{} listens on port {} already", program, port);
  if (or_any_port) {
    return findings.note(topic, taken + "; a station would take another port that is free",
                         fmt::format("end that program, or choose a port of your own with --{} ADDR:PORT", what));
  }
  findings.problem(topic, taken + "; a station could not start",
                   fmt::format("end that program, or choose another port ({}.listen, or --{})", what, what));
}

}  // namespace

RunningStation look_for_station(const std::filesystem::path& data_dir) {
  RunningStation running;
  running.is_running = !storage::lock_is_free(data_dir / "station.sqlite");
  read_announcement(data_dir / "endpoints.json", running);
  if (!running.is_running || running.http.empty()) return running;
  running.answers = answers_within_patience(running.http);
  if (running.answers) ask(data_dir, running);
  return running;
}

void check_station(const RunningStation& running, const std::filesystem::path& data_dir, Findings& findings) {
  const std::string endpoints = (data_dir / "endpoints.json").string();
  if (!running.is_running && running.has_announcement) {
    return findings.problem(
        "station",
        fmt::format("no station runs, but {} is there: it was left by one that was killed (pid {}); its "
                    "address and the login links that it printed are of no use",
                    endpoints, running.pid),
        fmt::format("start the station again, which replaces it, or remove it: rm '{}'", endpoints));
  }
  if (!running.is_running) return findings.fine("station", "no station runs on this data folder now");
  if (running.http.empty()) {
    return findings.note("station", "a station runs, and has not announced its address: it starts, or the disk is full",
                         "run rheonaut doctor again in some seconds");
  }
  if (!running.answers) {
    return findings.problem(
        "station",
        fmt::format("the station (pid {}) does not answer on {} within 5 s: it hangs, is halted, "
                    "or the machine is overloaded",
                    running.pid, running.http),
        fmt::format("look at its log; restart it (systemctl restart rheonaut, or kill {})", running.pid));
  }
  if (!running.problem.empty()) {
    return findings.note(
        "station",
        fmt::format("the station answers on {}, but could not be asked: {}", running.http, one_line(running.problem)),
        "run rheonaut doctor as the user that runs the station, who may read its token");
  }
  const std::string version = running.station.value("version", "");
  if (version != base::version()) {
    findings.problem("station",
                     fmt::format("the station that runs is version {}, this program is {}", version, base::version()),
                     "restart the station, so that it runs the installed version");
  } else {
    findings.fine("station", fmt::format("version {} runs and answers on {} (pid {}); a login link works once, for 10 "
                                         "minutes",
                                         version, running.http, running.pid));
  }
  const auto& why = running.recording["problem"];
  const std::string state = running.recording.value("state", "");
  if (state == "recording") return findings.fine("recording", "everything that arrives becomes durable");
  findings.problem("recording", fmt::format("{}: {}", state, why.is_string() ? why.get<std::string>() : ""),
                   "docs/operations.md, \"Is everything being recorded?\"");
}

void check_ports(const RunningStation& running, const config::Config& config, Findings& findings) {
  const bool runs = running.is_running && !running.http.empty();
  if (running.is_running && !runs) return;  // it is starting
  check_port("http", runs ? running.http : config.http, runs, config.http_or_any_port, findings);
  check_port("robots", runs ? running.robots : config.robots, runs, config.robots_or_any_port, findings);
}

}  // namespace server::cli
