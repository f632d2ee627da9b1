// Credentials: the station's token, one-time login codes, and the sessions of pages.
//
// The token (256 random bits, base64url) stands in `rheonaut.token`, mode 0600, in the data folder and stays the same
// over restarts. Sessions stand in `rheonaut.sessions`, as hashes, so that a page comes back by itself when the station
// does. Codes live in memory only. What is compared is a BLAKE2b hash, in constant time. Loop thread.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <list>
#include <optional>
#include <string>

#include "server/clock.hpp"

namespace server {

inline constexpr const char* kSessionCookie = "rheonaut_session";
inline constexpr microseconds kLoginCodeLife{std::chrono::minutes{10}};
inline constexpr microseconds kSessionLife{std::chrono::hours{12}};  // from its last use
inline constexpr microseconds kSessionSaveInterval{std::chrono::hours{1}};
inline constexpr microseconds kCookieLife{
    std::chrono::days{30}};  // in the browser; the station decides what it is worth
inline constexpr std::size_t kMaxLoginCodes = 16;
inline constexpr std::size_t kMaxSessions = 64;

class Auth {
 public:
  // Reads the token and the sessions, or makes a token. Throws std::runtime_error that names the file.
  Auth(Clock& clock, const std::filesystem::path& data_dir);

  std::string new_login_code();  // the oldest code is forgotten when there are too many

  // The secret of a new session, for its cookie; empty when the code is unknown, used or too old.
  std::optional<std::string> log_in(const std::string& code);

  // Who the secret belongs to: "token:local", "session:3"; empty when nobody.
  std::optional<std::string> actor_of_token(const std::string& token) const;
  // A session that is used is renewed.
  std::optional<std::string> actor_of_session(const std::string& secret);

 private:
  using Hash = std::array<unsigned char, 32>;
  struct Secret {
    Hash hash{};
    std::int64_t ends_at_us = 0;  // steady for a code, UTC for a session, which outlives the program
    std::uint64_t number = 0;
    std::int64_t saved_end_us = 0;  // as in the file, so at most an hour before ends_at_us
  };

  static Hash hash_of(const std::string& secret);
  static bool same(const Hash& a, const Hash& b);
  void forget_expired();
  void load_sessions();
  void save_sessions();
  void renew(Secret& session);

  Clock& clock_;
  std::filesystem::path sessions_file_;
  Hash token_{};
  std::list<Secret> codes_;     // oldest first
  std::list<Secret> sessions_;  // oldest first
  std::uint64_t next_session_ = 1;
};

}  // namespace server
