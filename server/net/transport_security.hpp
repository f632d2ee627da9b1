// The protection of the two ports: limits of connections, which of them uses TLS, with which certificate, and warnings
// in the log.
//
// The certificate's files are checked every two seconds. Changed files that are the same at the next check are used for
// new connections; unusable files are an error in the log, and the old ones stay in force. The log warns once a day of
// a certificate that ends within 30 days, and once an hour of a port that anybody on the network can read or change.
// Loop thread; owns the worker that computes handshakes.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/config/config.hpp"
#include "server/net/port_access.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/worker.hpp"

namespace server::net {

inline constexpr microseconds kCertificateCheckInterval{std::chrono::seconds{2}};
inline constexpr microseconds kExpiryWarning{std::chrono::days{30}};
inline constexpr microseconds kExposedReminder{std::chrono::hours{1}};

class TransportSecurity {
 public:
  // Reads the certificate when a port needs it. Throws std::runtime_error saying what is missing and how to make it.
  TransportSecurity(runtime::Clock& clock, const config::Config& config);

  PortAccess& http() { return http_; }
  PortAccess& robots() { return robots_; }
  const PortAccess& http() const { return http_; }
  const PortAccess& robots() const { return robots_; }

  boost::asio::awaitable<void> run();  // watches and warns until cancelled

  // Names that the certificate gives the station, for the Host header.
  std::vector<std::string> names() const;
  // As `security` of GET /api/v1/station: {"http": "tls", "robots": "plain", "exposed": false, "certificate": {…}|null}
  nlohmann::json state() const;
  // The certificate that programs on this machine need to trust the port, which is one of this; empty: it is plain.
  std::string to_trust(const PortAccess& port) const;

  const runtime::WorkerThread& worker() const { return worker_; }
  const tls::TlsHandshakes* handshakes() const { return handshakes_ ? &*handshakes_ : nullptr; }
  bool is_exposed() const { return !exposed_.empty(); }

 private:
  // What one check of the files found.
  struct FileCheck {
    std::string stamp;                               // differs when a file has changed
    std::shared_ptr<const tls::TlsContext> context;  // null: nothing new, or a problem
    std::string problem;
  };

  static FileCheck check(const std::filesystem::path& certificate, const std::filesystem::path& key,
                         const std::string& tried, const std::string& seen);
  boost::asio::awaitable<void> watch_files();
  void apply(FileCheck found);
  void remind();

  runtime::Clock& clock_;
  std::filesystem::path certificate_, key_;
  std::string exposed_;  // the ports that are, for people
  runtime::WorkerThread worker_{"handshakes", 10};
  std::optional<tls::TlsHandshakes> handshakes_;
  PortAccess http_, robots_;
  std::string tried_, seen_;  // stamps of the files
  std::int64_t next_exposed_us_ = 0, next_expiry_us_ = 0;
};

}  // namespace server::net
