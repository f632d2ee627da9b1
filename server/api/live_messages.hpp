// The messages of a page on /live, parsed without a socket.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "server/identity/caller.hpp"
#include "server/live/live_feed.hpp"
#include "server/live/robot_texts.hpp"
#include "server/runtime/result.hpp"
#include "server/runtime/tasks.hpp"
#include "server/runtime/turns.hpp"
#include "server/station/station.hpp"

namespace server::api {

// An id by which open connections of one page go. A page that connects anew goes by its old one; the copy of a tab does
// not.
struct OpenClient {
  std::string page;  // what each page that is loaded chooses anew
  std::size_t connections = 0;
};

// Everything outlives every page.
struct LiveParts {
  boost::asio::io_context& loop;
  runtime::TaskGroup& tasks;
  runtime::Clock& clock;
  station::Station& station;
  live::LiveFeed& live;
  live::RobotTexts& texts;
  std::string version;
  std::size_t renewals = 0;       // on their way
  runtime::Turns turns{loop, 3};  // of the pages that something is written to: some 70 µs of work
  // A sign of life for an experiment.
  std::function<void(std::int64_t id, const station::Client& client, microseconds age)> keep_experiment =
      [](std::int64_t, const station::Client&, microseconds) {};
  std::map<std::string, OpenClient> clients{};  // ids of open pages, behind their actors
};

inline constexpr std::size_t kMaxMessageBytes = 4096;
inline constexpr std::size_t kMaxRenewals = 256;
inline constexpr std::size_t kMaxWatched = 64;  // robots, of a page
inline constexpr std::size_t kMaxKept = 200;    // experiments, in one sign of life

// The first message of a page. Its stamp is of now: the states in it are as new or newer.
live::RobotDocument welcome_message(const identity::Caller& caller, const LiveParts& parts);

// Acts on one message. Returns at once: a stop or a renewal goes on as a task, and its outcome is published as
// `command`. The error, if any, is for the page.
Result<void> on_page_message(const std::string& text, const identity::Caller& caller, live::Subscriber& page,
                             LiveParts& parts);

// What its sender needs: of a type that is not known, command; of a text that is no message, read.
identity::Scope scope_needed_by(const std::string& text);

// `needed`: of the message that was refused.
std::string problem_message(const Error& error, identity::Scope needed);

}  // namespace server::api
