// Decides per port, watches the certificate's files, reminds people.
#include "server/net/transport_security.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "server/runtime/exceptions.hpp"

namespace server::net {
namespace fs = std::filesystem;
namespace asio = boost::asio;

namespace {

constexpr std::int64_t kDayUs = microseconds{std::chrono::days{1}}.count();

// Changes when either file is written, replaced, or pointed elsewhere.
std::string stamp_of(const fs::path& certificate, const fs::path& key) {
  std::string stamp;
  for (const fs::path& file : {certificate, key}) {
    struct stat status{};
    if (::stat(file.c_str(), &status) != 0) return "missing";
    stamp += fmt::format("{}.{}:{}:{};", status.st_mtim.tv_sec, status.st_mtim.tv_nsec, status.st_size, status.st_ino);
  }
  return stamp;
}

std::string exposed_ports(const config::Config& config) {
  std::string ports;
  if (config.is_exposed(config.http)) ports = "http.listen = " + config.http;
  if (config.is_exposed(config.robots)) ports += (ports.empty() ? "" : ", ") + ("robots.listen = " + config.robots);
  return ports;
}

std::shared_ptr<const tls::TlsContext> load_first(const config::Config& config) {
  const fs::path certificate = config.tls_certificate();
  if (config.tls.certificate.empty() && !fs::exists(certificate)) {
    throw std::runtime_error{fmt::format(
        "a port is to speak TLS (http.listen = {}, robots.listen = {}) and there is no certificate '{}'. Make one: "
        "rheonaut certificate --data {}; or name yours as tls.certificate and tls.key; or listen on 127.0.0.1; or "
        "accept with tls.insecure = true that everyone on the way can read and change what is sent",
        config.http, config.robots, certificate.string(), config.data_dir.string())};
  }
  return tls::load_tls_context(certificate, config.tls_key());
}

void log_in_force(const tls::TlsCertificate& certificate) {
  spdlog::info("TLS: the certificate for {} is in force, sha256 pin {}", fmt::join(certificate.names, ", "),
               certificate.pin);
}

// Behind one address of this machine there may be many: a proxy, a test, a fleet. A quarter is left for all others.
ConnectionLimits limits(const config::PortPlaces& places, std::size_t unauthenticated) {
  return {places.connections, unauthenticated, places.of_address, places.connections - places.connections / 4, 0};
}

// The sender of a request is known at once, a robot after its hello.
ConnectionLimits http_limits(const config::PortPlaces& places) {
  ConnectionLimits of_http = limits(places, places.connections);
  of_http.reserve = 16;
  return of_http;
}
ConnectionLimits robot_limits(const config::PortPlaces& places) {
  return limits(places, std::max(places.connections / 4, 1U));
}

}  // namespace

TransportSecurity::TransportSecurity(runtime::Clock& clock, const config::Config& config)
    : clock_{clock},
      certificate_{config.tls_certificate()},
      key_{config.tls_key()},
      exposed_{exposed_ports(config)},
      http_{{clock, "http port", http_limits(config.http_places)}, nullptr},
      robots_{{clock, "robot port", robot_limits(config.robot_places)}, nullptr} {
  const bool http_is_secure = config.speaks_tls(config.http), robots_are_secure = config.speaks_tls(config.robots);
  if (http_is_secure || robots_are_secure) {
    tried_ = seen_ = stamp_of(certificate_, key_);
    handshakes_.emplace(clock_, worker_, load_first(config));
    if (http_is_secure) http_.tls = &*handshakes_;
    if (robots_are_secure) robots_.tls = &*handshakes_;
    log_in_force(handshakes_->context().certificate);
  }
  remind();
}

asio::awaitable<void> TransportSecurity::run() {
  for (;;) {
    co_await clock_.sleep_for(kCertificateCheckInterval);
    if (handshakes_) co_await watch_files();
    remind();
  }
}

asio::awaitable<void> TransportSecurity::watch_files() {
  auto job = [certificate = certificate_, key = key_, tried = tried_, seen = seen_] {
    return check(certificate, key, tried, seen);
  };
  FileCheck found = co_await worker_.run(std::move(job));
  apply(std::move(found));
}

// On the worker. Files that have changed since the last check may still be changing: a renewal writes two.
TransportSecurity::FileCheck TransportSecurity::check(const fs::path& certificate, const fs::path& key,
                                                      const std::string& tried, const std::string& seen) {
  FileCheck found;
  found.stamp = stamp_of(certificate, key);
  if (found.stamp == tried || found.stamp != seen) return found;
  try {
    found.context = tls::load_tls_context(certificate, key);
  } catch (const std::exception& error) {
    found.problem = runtime::text_of(error);
  }
  return found;
}

void TransportSecurity::apply(FileCheck found) {
  seen_ = found.stamp;
  if (!found.problem.empty()) {
    tried_ = found.stamp;
    spdlog::error("TLS: the new certificate is not used, the one before stays in force: {}", found.problem);
  } else if (found.context) {
    tried_ = found.stamp;
    handshakes_->use(std::move(found.context));
    next_expiry_us_ = 0;
    log_in_force(handshakes_->context().certificate);
  }
}

void TransportSecurity::remind() {
  const std::int64_t now_us = clock_.steady_us();
  if (is_exposed() && now_us >= next_exposed_us_) {  // SAFETY: the operator must not be able to overlook it
    next_exposed_us_ = now_us + kExposedReminder.count();
    spdlog::error(
        "INSECURE: {} speaks plain TCP beyond this machine (tls.insecure = true): everyone on the way can read the "
        "token and drive the robots",
        exposed_);
  }
  if (!handshakes_ || now_us < next_expiry_us_) return;
  next_expiry_us_ = now_us + kDayUs;
  const std::int64_t left_us = handshakes_->context().certificate.not_after_us - clock_.utc_us();
  if (left_us <= 0) {
    spdlog::error("TLS: the certificate '{}' has expired; renew it: rheonaut certificate --renew",
                  certificate_.string());
  } else if (left_us < kExpiryWarning.count()) {
    spdlog::warn("TLS: the certificate '{}' expires in {} days; renew it: rheonaut certificate --renew",
                 certificate_.string(), left_us / kDayUs);
  }
}

std::vector<std::string> TransportSecurity::names() const {
  if (!handshakes_) return {};
  return handshakes_->context().certificate.names;
}

std::string TransportSecurity::to_trust(const PortAccess& port) const {
  return port.tls != nullptr ? fs::absolute(certificate_).string() : "";
}

nlohmann::json TransportSecurity::state() const {
  const auto word = [](const PortAccess& port) { return port.tls != nullptr ? "tls" : "plain"; };
  nlohmann::json out{
      {"http", word(http_)}, {"robots", word(robots_)}, {"exposed", is_exposed()}, {"certificate", nullptr}};
  if (handshakes_) {
    const tls::TlsCertificate& certificate = handshakes_->context().certificate;
    out["certificate"] = {{"names", certificate.names},
                          {"pin_sha256", certificate.pin},
                          {"not_after_us", certificate.not_after_us},
                          {"expires_soon", certificate.not_after_us - clock_.utc_us() < kExpiryWarning.count()}};
  }
  return out;
}

}  // namespace server::net
