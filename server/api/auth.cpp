// Makes, keeps and compares secrets.
#include "server/api/auth.hpp"

#include <sodium.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "server/private_file.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kSecretBytes = 32;
constexpr std::size_t kSecretText = sodium_base64_ENCODED_LEN(kSecretBytes, sodium_base64_VARIANT_URLSAFE_NO_PADDING);

std::string random_secret() {
  unsigned char bytes[kSecretBytes];
  randombytes_buf(bytes, sizeof bytes);
  char text[kSecretText];
  sodium_bin2base64(text, sizeof text, bytes, sizeof bytes, sodium_base64_VARIANT_URLSAFE_NO_PADDING);
  return text;
}

bool is_secret(const std::string& text) {
  unsigned char bytes[kSecretBytes];
  std::size_t size = 0;
  return sodium_base642bin(bytes, sizeof bytes, text.data(), text.size(), nullptr, &size, nullptr,
                           sodium_base64_VARIANT_URLSAFE_NO_PADDING) == 0 &&
         size == kSecretBytes;
}

[[noreturn]] void cannot(const char* what, const fs::path& file) {
  throw std::runtime_error{std::string{"cannot "} + what + " " + file.string() + ": " + std::strerror(errno)};
}

std::string load_or_make_token(const fs::path& file) {
  std::string token;
  std::ifstream in{file};
  std::getline(in, token);
  if (is_secret(token)) {
    struct stat status{};
    if (::stat(file.c_str(), &status) != 0) cannot("look at", file);
    if ((status.st_mode & 077U) != 0) {
      spdlog::warn("{} was readable by others (mode {:o}); now it is not", file.string(), status.st_mode & 0777U);
      if (::chmod(file.c_str(), 0600) != 0) cannot("protect", file);
    }
    return token;
  }
  if (fs::exists(file)) spdlog::warn("{} held no valid token; a new one was made", file.string());
  token = random_secret();
  write_private(file, token + "\n");
  return token;
}

}  // namespace

Auth::Auth(Clock& clock, const fs::path& data_dir) : clock_{clock}, sessions_file_{data_dir / "rheonaut.sessions"} {
  if (sodium_init() < 0) throw std::runtime_error{"libsodium cannot start: no source of random numbers"};
  token_ = hash_of(load_or_make_token(data_dir / "rheonaut.token"));
  load_sessions();
}

// One session a line: number, end (UTC, µs), hash in hexadecimal. A line that is none ends the reading.
void Auth::load_sessions() {
  std::ifstream in{sessions_file_};
  Secret session;
  std::string hex;
  while (sessions_.size() < kMaxSessions && in >> session.number >> session.ends_at_us >> hex) {
    std::size_t size = 0;
    const int read =
        sodium_hex2bin(session.hash.data(), session.hash.size(), hex.data(), hex.size(), nullptr, &size, nullptr);
    if (read != 0 || size != session.hash.size()) break;
    session.saved_end_us = session.ends_at_us;
    sessions_.push_back(session);
    next_session_ = std::max(next_session_, session.number + 1);
  }
  forget_expired();
}

void Auth::save_sessions() {
  std::string lines;
  for (const Secret& session : sessions_) {
    char hex[2 * sizeof session.hash + 1];
    sodium_bin2hex(hex, sizeof hex, session.hash.data(), session.hash.size());
    lines += std::to_string(session.number) + ' ' + std::to_string(session.ends_at_us) + ' ' + hex + '\n';
  }
  write_private(sessions_file_, lines);
  for (Secret& session : sessions_) session.saved_end_us = session.ends_at_us;
}

// SAFETY: a full disk must not refuse who is signed in, so a session that cannot be saved is renewed all the same.
void Auth::renew(Secret& session) {
  session.ends_at_us = std::max(session.ends_at_us, clock_.utc_us() + kSessionLife.count());
  if (session.ends_at_us - session.saved_end_us < kSessionSaveInterval.count()) return;
  try {
    save_sessions();
  } catch (const std::exception& error) {
    session.saved_end_us = session.ends_at_us;  // tried again in an hour
    spdlog::warn("the renewed session {} is not saved: {}", session.number, error.what());
  }
}

Auth::Hash Auth::hash_of(const std::string& secret) {
  Hash hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(secret.data()), secret.size(),
                     nullptr, 0);
  return hash;
}

bool Auth::same(const Hash& a, const Hash& b) { return sodium_memcmp(a.data(), b.data(), a.size()) == 0; }

void Auth::forget_expired() {
  const auto ended_by = [](std::int64_t now_us) {
    return [now_us](const Secret& secret) { return secret.ends_at_us <= now_us; };
  };
  codes_.remove_if(ended_by(clock_.steady_us()));
  sessions_.remove_if(ended_by(clock_.utc_us()));
}

std::string Auth::new_login_code() {
  forget_expired();
  if (codes_.size() >= kMaxLoginCodes) codes_.pop_front();
  const std::string code = random_secret();
  codes_.push_back({hash_of(code), clock_.steady_us() + kLoginCodeLife.count(), 0});
  return code;
}

std::optional<std::string> Auth::log_in(const std::string& code) {
  forget_expired();
  const Hash hash = hash_of(code);
  const auto used = codes_.remove_if([&hash](const Secret& secret) { return same(secret.hash, hash); });
  if (used == 0) return std::nullopt;
  if (sessions_.size() >= kMaxSessions) sessions_.pop_front();
  const std::string session = random_secret();
  sessions_.push_back({hash_of(session), clock_.utc_us() + kSessionLife.count(), next_session_++});
  save_sessions();
  return session;
}

std::optional<std::string> Auth::actor_of_token(const std::string& token) const {
  if (!same(hash_of(token), token_)) return std::nullopt;
  return "token:local";
}

std::optional<std::string> Auth::actor_of_session(const std::string& secret) {
  const Hash hash = hash_of(secret);
  for (Secret& session : sessions_) {
    if (same(session.hash, hash) && session.ends_at_us > clock_.utc_us()) {
      renew(session);
      return "session:" + std::to_string(session.number);
    }
  }
  return std::nullopt;
}

}  // namespace server
