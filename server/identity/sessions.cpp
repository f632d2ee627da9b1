// A bounded list that is searched as a whole.
#include "server/identity/sessions.hpp"

#include <sodium.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "server/runtime/private_file.hpp"

namespace server::identity {
namespace {

constexpr std::size_t kMaxAgentBytes = 120;

bool read_hex(const std::string& hex, runtime::SecretHash& hash) {
  std::size_t size = 0;
  return sodium_hex2bin(hash.data(), hash.size(), hex.data(), hex.size(), nullptr, &size, nullptr) == 0 &&
         size == hash.size();
}

}  // namespace

void Sessions::load(const std::vector<PageSession>& stored, std::uint64_t next_number) {
  for (const PageSession& session : stored) {
    sessions_.push_back({session, std::make_shared<Standing>(loop_), session.ends_at_us});
  }
  next_number_ = next_number;
  sweep();
}

// One session a line: number, end (UTC, µs), hash in hexadecimal. A line that is none ends the reading.
std::size_t Sessions::take_over(const std::filesystem::path& file) {
  std::istringstream in{runtime::read_private(file).value_or("")};
  PageSession session;
  std::string hex;
  std::size_t taken = 0;
  while (taken < kMaxSessionsOfLinks && in >> session.number >> session.ends_at_us >> hex) {
    if (!read_hex(hex, session.hash)) break;
    if (runtime::find_secret(sessions_, session.hash) != nullptr || session.ends_at_us <= clock_.utc_us()) continue;
    next_number_ = std::max(next_number_, session.number + 1);
    session.made_at_us = session.last_used_at_us = clock_.utc_us();
    sessions_.push_back({session, std::make_shared<Standing>(loop_), 0});
    ++taken;
  }
  revision_ += taken;
  return taken;
}

std::string Sessions::add(const std::string& user, const std::string& peer, const std::string& agent) {
  sweep();
  make_room(user);
  std::string secret = runtime::random_secret();
  const std::int64_t now_us = clock_.utc_us();
  const PageSession session{next_number_++, runtime::hash_of(secret),          user, now_us,
                            now_us,         now_us + kSessionValidity.count(), peer, agent.substr(0, kMaxAgentBytes)};
  sessions_.push_back({session, std::make_shared<Standing>(loop_), 0});
  ++revision_;
  return secret;
}

void Sessions::make_room(const std::string& user) {
  const std::size_t most = user.empty() ? kMaxSessionsOfLinks : kMaxSessionsOfUser;
  const auto is_of_user = [&user](const Open& session) { return session.user == user; };
  while (static_cast<std::size_t>(std::ranges::count_if(sessions_, is_of_user)) >= most) {
    auto unused = sessions_.end();
    for (auto session = sessions_.begin(); session != sessions_.end(); ++session) {
      if (!is_of_user(*session)) continue;
      if (unused == sessions_.end() || session->ends_at_us < unused->ends_at_us) unused = session;
    }
    remove(unused);
  }
}

const Sessions::Open* Sessions::find(const std::string& secret) {
  Open* session = runtime::find_secret(sessions_, runtime::hash_of(secret));
  if (session == nullptr) return nullptr;
  if (session->ends_at_us <= clock_.utc_us() && !is_open(*session)) {
    end(session->number);  // it stays so when the clock is set back
    return nullptr;
  }
  renew(*session);
  return session;
}

// SAFETY: the page that an operator has open is never signed out for want of requests: only we hold the standing of one
// that nobody has open.
bool Sessions::is_open(const Open& session) { return session.standing.use_count() > 1; }

void Sessions::renew(Open& session) {
  session.last_used_at_us = clock_.utc_us();
  session.ends_at_us = session.last_used_at_us + kSessionValidity.count();
  if (std::abs(session.ends_at_us - session.saved_end_us) < kSessionSaveInterval.count()) return;
  session.saved_end_us = session.ends_at_us;  // if it cannot be saved, the next hour tries again
  ++revision_;
}

void Sessions::remove(std::list<Open>::iterator session) {
  session->standing->end();
  sessions_.erase(session);
  ++revision_;
}

bool Sessions::end(std::uint64_t number) {
  const auto session = std::ranges::find(sessions_, number, &Open::number);
  if (session == sessions_.end()) return false;
  remove(session);
  return true;
}

void Sessions::end_of_user(const std::string& user) {
  for (auto session = sessions_.begin(); session != sessions_.end();) {
    const auto each = session++;
    if (each->user == user) remove(each);
  }
}

void Sessions::renew_standing(const std::string& user) {
  for (Open& session : sessions_) {
    if (session.user != user) continue;
    session.standing->end();
    session.standing = std::make_shared<Standing>(loop_);
  }
}

void Sessions::sweep() {
  const std::int64_t now_us = clock_.utc_us();
  for (auto session = sessions_.begin(); session != sessions_.end();) {
    const auto each = session++;
    each->ends_at_us = std::min(each->ends_at_us, now_us + kSessionValidity.count());  // the clock was ahead
    if (is_open(*each)) renew(*each);
    if (each->ends_at_us <= now_us) remove(each);
  }
}

std::vector<PageSession> Sessions::rows() const { return {sessions_.begin(), sessions_.end()}; }

void Sessions::on_saved() {
  for (Open& session : sessions_) session.saved_end_us = session.ends_at_us;
}

}  // namespace server::identity
