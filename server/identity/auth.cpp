// Makes, keeps and compares the station's own secrets.
#include "server/identity/auth.hpp"

#include <fmt/format.h>
#include <sodium.h>
#include <spdlog/spdlog.h>

#include "server/runtime/private_file.hpp"

namespace server::identity {
namespace {

namespace fs = std::filesystem;

std::string load_or_make_token(const fs::path& file) {
  const auto content = runtime::read_private(file);
  if (content) {
    std::string token = content->substr(0, content->find('\n'));
    if (runtime::is_secret(token)) return token;
    spdlog::warn("{} held no valid token; a new one was made", file.string());
  }
  std::string token = runtime::random_secret();
  runtime::write_private(file, token + "\n");
  return token;
}

}  // namespace

Auth::Auth(boost::asio::io_context& loop, runtime::Clock& clock, Accounts& accounts, const fs::path& data_dir,
           std::uint64_t store_id)
    : clock_{clock},
      accounts_{accounts},
      cookie_name_{fmt::format("rheonaut_session_{:016x}", store_id)},
      token_{runtime::hash_of(load_or_make_token(data_dir / "rheonaut.token"))},
      token_standing_{std::make_shared<Standing>(loop)} {}

std::string Auth::new_login_code() {
  std::erase_if(codes_, [now_us = clock_.steady_us()](const Code& code) { return code.ends_at_us <= now_us; });
  if (codes_.size() >= kMaxLoginCodes) codes_.pop_front();
  std::string code = runtime::random_secret();
  codes_.push_back({runtime::hash_of(code), clock_.steady_us() + kLoginCodeValidity.count()});
  return code;
}

std::optional<std::string> Auth::log_in(const std::string& code, const std::string& peer, const std::string& agent) {
  const Code* found = runtime::find_secret(codes_, runtime::hash_of(code));
  const bool in_time = found != nullptr && found->ends_at_us > clock_.steady_us();
  codes_.remove_if([found](const Code& each) { return &each == found; });
  if (!in_time) {
    accounts_.on_refused_sign_in("", peer, "bad_link");
    return std::nullopt;
  }
  return accounts_.open_session("", peer, agent);
}

std::optional<Caller> Auth::caller_of_token(const std::string& token) const {
  if (runtime::same(runtime::hash_of(token), token_))
    return Caller{"token:local", "", Scopes::of(Role::admin), 0, token_standing_, {}};
  return accounts_.caller_of_token(token);
}

std::optional<Caller> Auth::caller_of_session(const std::string& secret) const {
  return accounts_.caller_of_session(secret);
}

std::string Auth::cookie(const std::string& secret, bool is_secure) const {
  constexpr int kLongest_s = 400 * 24 * 60 * 60;  // as long as a browser keeps one
  const int life_s = secret.empty() ? 0 : kLongest_s;
  return fmt::format("{}={}; HttpOnly; SameSite=Strict; Path=/; Max-Age={}{}", cookie_name_, secret, life_s,
                     is_secure ? "; Secure" : "");
}

Result<void> still_stands(const Caller& caller) {
  if (caller.standing == nullptr || !caller.standing->ended()) return {};
  return std::unexpected{credential_ended(caller.actor)};
}

Error credential_ended(const std::string& actor) {
  return {
      ErrorCode::forbidden,
      fmt::format("the credential of {} was revoked, has expired or has other rights now; sign in, or send it again",
                  actor),
      "not_permitted"};
}

}  // namespace server::identity
