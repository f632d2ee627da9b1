// Each function twice: a request, or a transaction.
#include "server/cli/accounts/account_access.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <termios.h>
#include <unistd.h>

#include <functional>
#include <iostream>
#include <stdexcept>

#include "base/whole_file.hpp"
#include "server/cli/accounts/author.hpp"
#include "server/runtime/private_file.hpp"

namespace server::cli {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::int64_t kDayUs = 86'400'000'000;

template <class T>
T value_of(Result<T> result) {
  if (!result) throw std::runtime_error{result.error().detail};
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

template <class Items>
json list_of(const Items& items) {
  json list = json::array();
  for (const auto& item : items) list.push_back(to_json(item));
  return list;
}

// Shows nothing of what is typed, until it ends.
class Silence {
 public:
  Silence() {
    tcgetattr(STDIN_FILENO, &before_);
    termios silent = before_;
    silent.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &silent);
  }
  ~Silence() { tcsetattr(STDIN_FILENO, TCSAFLUSH, &before_); }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  termios before_{};
};

constexpr std::size_t kLongestTyped = 64 * 1024;  // no password is as long, but its length is said then

std::string read_password_line() {
  base::WholeFile line = base::read_line(std::cin, kLongestTyped);
  if (std::cin.eof() && line.text.empty()) throw std::runtime_error{"no password was given on standard input"};
  if (!line.problem.empty()) {
    throw std::runtime_error{fmt::format("the line of the password on standard input {}", line.problem)};
  }
  return std::move(line.text);
}

std::string ask_silently(const std::string& question) {
  const Silence silence;  // before the question: what is typed early is not shown either
  fmt::print(stderr, "{}: ", question);
  std::string line = read_password_line();
  fmt::print(stderr, "\n");
  return line;
}

}  // namespace

AccountAccess::AccountAccess(const fs::path& data_dir, Missing missing) {
  const fs::path database = data_dir / "station.sqlite";
  if (missing == Missing::make) {
    config::make_data_folder(data_dir);
  } else if (!runtime::is_there(database)) {
    throw std::runtime_error{fmt::format("there is no '{}'", database.string())};
  }
  if (auto lock = config::FolderLock::try_take(data_dir)) {
    lock_.emplace(std::move(*lock));
    database_ = std::make_unique<storage::Database>(database);
  } else {
    station_.emplace(data_dir);
  }
}

json AccountAccess::ask(const std::string& method, const std::string& target, const json& body) const {
  const StationAnswer answer = station_->ask(method, "/api/v1" + target, body);
  constexpr int kFirstProblem = 300;
  if (answer.status < kFirstProblem) return answer.body;
  throw std::runtime_error{answer.body.value("detail", fmt::format("the station answers {}", answer.status))};
}

json AccountAccess::users() { return station_ ? ask("GET", "/users").at("users") : list_of(store().load().users); }

void AccountAccess::add_user(const std::string& name, identity::Role role, const std::string& password) {
  if (station_) {
    ask("POST", "/users", {{"name", name}, {"role", text(role)}, {"password", password}});
    return;
  }
  value_of(identity::check_name(name));
  value_of(identity::check_password(password));
  const station::Author by = command_line_author();
  value_of(store().add_user({name, role, runtime::hash_password(password, {}), by.at_us, by.actor, false}, by));
}

template <class Change>
void AccountAccess::act(const std::string& list, const std::string& name, const std::string& act, const json& body,
                        const Change& change) {
  value_of(identity::check_name(name));
  if (station_) {
    ask("POST", fmt::format("/{}/{}/{}", list, name, act), body);
  } else {
    identity::AccountStore accounts = store();
    value_of(std::invoke(change, accounts, name, command_line_author()));
  }
}

void AccountAccess::change_user(const std::string& name, const identity::UserChange& change, const json& body) {
  act("users", name, "change", body, [&change](auto& accounts, const std::string& user, const station::Author& by) {
    return accounts.change_user(user, change, by);
  });
}

void AccountAccess::set_role(const std::string& name, identity::Role role) {
  change_user(name, {role, {}, {}}, {{"role", text(role)}});
}

void AccountAccess::set_password(const std::string& name, const std::string& password) {
  value_of(identity::check_password(password));
  identity::UserChange change;
  if (!station_) change.password_hash = runtime::hash_password(password, {});
  change_user(name, change, {{"password", password}});
}

void AccountAccess::set_disabled(const std::string& name, bool disabled) {
  change_user(name, {{}, {}, disabled}, {{"disabled", disabled}});
}

void AccountAccess::remove_user(const std::string& name) {
  act("users", name, "remove", nullptr, &identity::AccountStore::remove_user);
}

json AccountAccess::tokens() { return station_ ? ask("GET", "/tokens").at("tokens") : list_of(store().load().tokens); }

json AccountAccess::add_token(const std::string& name, identity::Scopes scopes, std::int64_t days) {
  json body{{"name", name}, {"scopes", text(scopes)}};
  if (days != 0) body["days"] = days;
  if (station_) return ask("POST", "/tokens", body);
  value_of(identity::check_name(name));
  if (name == "local") throw std::runtime_error{"local is the name of the station's own token"};
  const std::string secret = runtime::random_secret();
  identity::ApiToken token;
  token.name = name;
  token.hash = runtime::hash_of(secret);
  token.scopes = scopes;
  const station::Author by = command_line_author();
  token.made_at_us = by.at_us;
  token.expires_at_us = days == 0 ? 0 : token.made_at_us + days * kDayUs;
  value_of(store().add_token(token, by));
  json made = to_json(token);
  made["secret"] = secret;
  return made;
}

void AccountAccess::revoke_token(const std::string& name) {
  act("tokens", name, "revoke", nullptr, &identity::AccountStore::revoke_token);
}

void AccountAccess::revive_token(const std::string& name) {
  act("tokens", name, "revive", nullptr, [](auto& accounts, const std::string& token, const station::Author& by) {
    return accounts.revive_token(token, 0, by);
  });
}

json AccountAccess::enrolments() {
  return station_ ? ask("GET", "/enrolments").at("enrolments") : list_of(store().enrolments());
}

json AccountAccess::enrol(const std::string& robot_id) {
  if (station_) return ask("POST", "/enrolments", {{"robot_id", robot_id}});
  const std::string secret = runtime::random_secret();
  json made = to_json(value_of(store().enrol(robot_id, runtime::hash_of(secret), command_line_author())));
  made["secret"] = secret;
  return made;
}

std::optional<std::uint64_t> AccountAccess::revoke_robot(const std::string& robot_id) {
  if (station_) {
    const json answer = ask("POST", "/enrolments/" + robot_id + "/revoke");
    const json given_up = answer.value("samples_given_up", json{});
    return given_up.is_number() ? std::optional{given_up.get<std::uint64_t>()} : std::nullopt;
  }
  value_of(store().revoke_robot(robot_id, command_line_author()));
  return std::nullopt;
}

void AccountAccess::set_retired(const std::string& robot_id, bool retired) {
  if (station_) {
    ask("POST", "/robots/" + robot_id + "/retire", {{"retired", retired}});
  } else {
    value_of(store().set_retired(robot_id, retired, command_line_author()));
  }
}

std::string read_password(const std::string& whose) {
  if (isatty(STDIN_FILENO) == 0) return read_password_line();
  std::string password = ask_silently("Password of " + whose);
  if (ask_silently("The same again") != password) throw std::runtime_error{"the two passwords differ"};
  return password;
}

std::string time_text(const json& at_us) {
  if (at_us.is_null()) return {};
  return fmt::format("{:%Y-%m-%d %H:%M}", fmt::gmtime(static_cast<std::time_t>(at_us.get<std::int64_t>() / 1'000'000)));
}

}  // namespace server::cli
