// Feeds any header fields to the guard in front of all routes: nobody is let in without a secret where one is needed.
//
// A line each: method, target, then fields as "name:value". SESSION and TOKEN in them stand for the two secrets that
// are good.
#include <stdlib.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>

#include "server/http/request_guard.hpp"
#include "server/http/router.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

std::filesystem::path new_folder() {
  std::string name = (std::filesystem::temp_directory_path() / "rheonaut-fuzz-XXXXXX").string();
  require(mkdtemp(name.data()) != nullptr);
  return name;
}

// Who may come in, in memory: the folder is removed as soon as it is read.
struct Gatehouse {
  Gatehouse() {
    session = accounts.open_session("", "", "");
    std::ifstream{folder / "rheonaut.token"} >> token;
    std::filesystem::remove_all(folder);
  }

  std::filesystem::path folder = new_folder();
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  storage::Database database{folder / "station.sqlite"};
  runtime::WorkerThread disk{"disk"}, checkpoints{"checkpoints"};
  storage::Recorder recorder{loop, clock, disk, checkpoints, storage::RecorderOptions{folder / "station.sqlite", {}}};
  const storage::RemovalClock removal_clock{clock};
  identity::Accounts accounts{loop, clock, recorder, removal_clock, folder};
  identity::Auth auth{loop, clock, accounts, folder, 1};
  http::RequestGuard guard{auth, {"station.lab"}};
  std::string token, session;
};

std::string with(std::string text, std::string_view word, const std::string& secret) {
  const auto at = text.find(word);
  return at == std::string::npos ? text : text.replace(at, word.size(), secret);
}

// As RFC 6265 has it, in other words than the guard's: pairs between semicolons, spaces around none of them.
std::string first_cookie(const std::string& header, const std::string& name) {
  std::istringstream pairs{header};
  for (std::string pair; std::getline(pairs, pair, ';');) {
    pair.erase(0, std::min(pair.find_first_not_of(' '), pair.size()));
    if (pair.starts_with(name + "=")) return pair.substr(name.size() + 1);
  }
  return {};
}

http::Request request_of(const std::string& text, const Gatehouse& house) {
  std::istringstream lines{text};
  http::Request request;
  std::getline(lines, request.method);
  std::string target;
  std::getline(lines, target);
  request.target = std::move(target);
  for (std::string line; std::getline(lines, line);) {
    const auto colon = std::min(line.find(':'), line.size());
    const std::string value = line.substr(std::min(colon + 1, line.size()));
    request.headers[line.substr(0, colon)] = with(with(value, "SESSION", house.session), "TOKEN", house.token);
  }
  return request;
}

void knock(const std::string& text) {
  static Gatehouse house;
  const http::Request request = request_of(text, house);
  const std::string cookies = request.header("cookie");
  const std::string own = first_cookie(cookies, house.auth.cookie_name());
  require(http::cookie_value(cookies, house.auth.cookie_name()) == own);

  const auto admitted = house.guard.admit(request);
  if (!admitted) {
    require(admitted.error().status >= 400 && admitted.error().status < 500);
    require(nlohmann::json::accept(admitted.error().body));
    return;
  }
  const std::string& path = request.target.path();
  require(request.target.is_acceptable());
  if (admitted->actor.empty()) {
    const bool holds_data = path.starts_with("/api/") || path == "/live" || path == "/metrics";
    require(!holds_data || (request.method == "POST" && path == "/api/v1/login"));
    return;
  }
  const std::string authorization = request.header("authorization");
  const bool by_token = authorization.size() == 7 + house.token.size() && authorization.ends_with(house.token);
  const bool by_cookie = authorization.empty() && own == house.session;
  require(by_token || by_cookie);
  const bool changes = request.method != "GET" && request.method != "HEAD" && request.method != "OPTIONS";
  const bool says_where = !request.header("origin").empty() || request.header("sec-fetch-site") == "same-origin";
  require(by_token || !changes || says_where);
}

}  // namespace
}  // namespace server

int fuzz::cookie(const std::uint8_t* data, std::size_t size) {
  server::knock({reinterpret_cast<const char*>(data), size});
  return 0;
}
