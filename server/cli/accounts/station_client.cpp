// Where the station is, and what a tool makes of its answers; station_requests.cpp has the connections.
#include "server/cli/accounts/station_client.hpp"

#include <fmt/format.h>

#include <optional>
#include <stdexcept>

#include "server/config/data_folder.hpp"
#include "server/config/endpoint.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/private_file.hpp"
#include "server/runtime/tasks.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::cli {
namespace asio = boost::asio;

namespace {

// SAFETY: from a file that another user of the machine wrote, the token would go to a program of theirs.
nlohmann::json announcement_in(const std::filesystem::path& file) {
  const std::optional<std::string> text = runtime::read_private(file);
  if (!text) {
    const std::filesystem::path folder = file.parent_path();
    if (!storage::lock_is_free(folder / "station.sqlite")) {
      throw std::runtime_error{fmt::format("{} uses '{}' and cannot be asked yet; wait until it is ready or has ended",
                                           config::FolderLock::holder(folder), folder.string())};
    }
    throw std::runtime_error{
        fmt::format("no station runs in '{0}': rheonaut serve --data '{0}' starts one", folder.string())};
  }
  auto content = nlohmann::json::parse(*text, nullptr, false);
  if (!content.is_object() || !content.contains("http")) {
    throw std::runtime_error{
        fmt::format("'{}' does not say where the station is: it is starting or stopping; try again", file.string())};
  }
  return content;
}

// A station that listens on every address is asked on loopback.
asio::ip::tcp::endpoint endpoint_of(const nlohmann::json& announcement) {
  auto endpoint = config::parse_endpoint(announcement["http"].get<std::string>());
  if (endpoint.address().is_unspecified()) endpoint.address(asio::ip::address_v4::loopback());
  return endpoint;
}

std::string token_of(const std::filesystem::path& file) {
  if (!runtime::is_there(file.parent_path())) {
    throw std::runtime_error{
        fmt::format("there is no folder '{}'; --data names that of a station", file.parent_path().string())};
  }
  if (!runtime::is_there(file)) {
    throw std::runtime_error{
        fmt::format("'{}' is no station's data folder, or its station has never run: there is no rheonaut.token in it",
                    file.parent_path().string())};
  }
  const std::string token = runtime::read_private(file).value_or("");
  const std::string line = token.substr(0, token.find('\n'));
  if (line.empty()) throw std::runtime_error{fmt::format("cannot read the station's token in '{}'", file.string())};
  return line;
}

}  // namespace

bool BusyWait::is_busy(const StationAnswer& answer) {
  if (!gave_way(answer)) {
    answered_at_us_ = clock_.steady_us();
    return false;
  }
  const microseconds longest = rule_.longest;
  if (clock_.steady_us() - answered_at_us_ >= longest.count()) {
    throw std::runtime_error{
        fmt::format("the station has been busy for {} s: all its connections are taken, and this question gave way to "
                    "others; {}",
                    std::chrono::duration_cast<std::chrono::seconds>(longest).count(), advice_)};
  }
  return true;
}

bool BusyWait::asks_again(const StationAnswer& answer) {
  if (!is_busy(answer)) return false;
  pause();
  return true;
}

void BusyWait::pause() {
  loop_.restart();
  runtime::run_first(loop_, clock_.sleep_for(rule_.pause));
}

std::string asks_for_job_again(std::int64_t job, const std::filesystem::path& data_dir) {
  return fmt::format("rheonaut job show {} --wait --data '{}' waits for it", job, data_dir.string());
}

nlohmann::json asked(StationAnswer answer) {
  constexpr int kFirstSuccess = 200, kFirstRedirection = 300;
  if (answer.status >= kFirstSuccess && answer.status < kFirstRedirection) return std::move(answer.body);
  const bool says_why = answer.body.is_object();
  throw std::runtime_error{
      fmt::format("the station refused: {}", says_why ? answer.body.value("detail", "no reason") : "no reason")};
}

StationClient::StationClient(const std::filesystem::path& data_dir)
    : data_dir_{data_dir}, token_{token_of(data_dir / "rheonaut.token")} {
  const nlohmann::json announcement = announcement_in(data_dir / "endpoints.json");
  place_.endpoint = endpoint_of(announcement);
  place_.certificate = announcement.value("tls_certificate", "");
}

StationAnswer StationClient::ask(const std::string& method, const std::string& target, const nlohmann::json& body,
                                 TimeLimit limit) const {
  StationAnswer answer = ask_at_once({{method, target, body}}, limit.time).front();
  if (answer.status != 0) return answer;
  const bool may_act = method != "GET" && answer.may_have_arrived;
  throw std::runtime_error{
      answer.text + (answer.is_silent ? advice(limit) : "") +
      (may_act ? "; the station may have got the request and act on it: look before you repeat it" : "")};
}

std::string StationClient::advice(TimeLimit limit) const {
  return fmt::format("; it is busy, hangs or is halted: rheonaut doctor --data '{}' examines it{}", data_dir_.string(),
                     limit.is_option ? "; --timeout-s waits longer" : "");
}

}  // namespace server::cli
