// Credentials: the owner of a token or a cookie, and the one-time codes by which a page signs in.
//
// The station's own token (256 random bits, base64url) stands in `rheonaut.token`, mode 0600, in the data folder, stays
// the same over restarts and may do everything; it is for scripts on this machine. Codes live in memory only. What is
// compared is a BLAKE2b hash, in constant time. Loop thread.
#pragma once

#include <filesystem>
#include <list>
#include <optional>
#include <string>

#include "server/identity/accounts.hpp"

namespace server::identity {

inline constexpr microseconds kLoginCodeValidity{std::chrono::minutes{10}};
inline constexpr std::size_t kMaxLoginCodes = 16;

class Auth {
 public:
  // Reads the token or makes one. Throws std::runtime_error that names the file.
  Auth(boost::asio::io_context& loop, runtime::Clock& clock, Accounts& accounts, const std::filesystem::path& data_dir,
       std::uint64_t store_id);

  std::string new_login_code();  // the oldest code is forgotten when there are too many

  // The secret of a new session, for its cookie; empty when the code is unknown, used or too old.
  std::optional<std::string> log_in(const std::string& code, const std::string& peer, const std::string& agent);

  // The caller whose token or session this is; none: nobody's. A session that is used is renewed.
  std::optional<Caller> caller_of_token(const std::string& token) const;
  std::optional<Caller> caller_of_session(const std::string& secret) const;

  // Browsers do not separate cookies of one host by port, so each station has a name of its own.
  const std::string& cookie_name() const { return cookie_name_; }
  // The value of Set-Cookie; an empty secret ends the cookie. It is set by signing in and never again, so that no
  // answer to another tab puts an older session in its place; that the session ends is the station's doing.
  // `is_secure`: for TLS only.
  std::string cookie(const std::string& secret, bool is_secure) const;

 private:
  struct Code {
    runtime::SecretHash hash{};
    std::int64_t ends_at_us = 0;  // steady
  };

  runtime::Clock& clock_;
  Accounts& accounts_;
  std::string cookie_name_;
  runtime::SecretHash token_{};
  std::shared_ptr<Standing> token_standing_;  // never ends
  std::list<Code> codes_;                     // oldest first
};

// SAFETY: nobody's credential outlives a wait: what has ended meanwhile, or has other rights now, commands nothing.
Result<void> still_stands(const Caller& caller);
Error credential_ended(const std::string& actor);  // what is said then

}  // namespace server::identity
