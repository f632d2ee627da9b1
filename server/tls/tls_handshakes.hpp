// Performs the TLS handshakes of connections and counts their results.
//
// The public-key arithmetic runs on a worker, one step of one handshake at a time in order of arrival, so that the loop
// is never blocked: neither by a thousand robots that reconnect at once nor by an RSA key. A silent client does not
// delay others. Each handshake has 10 s. The limits of connections of each port also bound the waiting handshakes. A
// failure is logged, at most one line a second, and ends that connection only. Loop thread. Outlives the handshakes.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/runtime/log.hpp"
#include "server/runtime/worker.hpp"
#include "server/tls/stream_socket.hpp"
#include "server/tls/tls_context.hpp"

namespace server::tls {

inline constexpr microseconds kHandshakeTime{std::chrono::seconds{10}};

struct TlsCounters {
  std::uint64_t handshakes = 0;  // that succeeded
  std::uint64_t resumed = 0;     // of them, without the certificate's key
  std::uint64_t failed = 0;
};

class TlsHandshakes {
 public:
  enum class Outcome : std::uint8_t {
    secure,
    failed,
    not_tls,  // the client began with something else, which waits to be read; counted as failed
  };

  TlsHandshakes(runtime::Clock& clock, runtime::WorkerThread& worker, std::shared_ptr<const TlsContext> context)
      : clock_{clock}, worker_{worker}, context_{std::move(context)} {}

  // `port` is for the log: "robot port". The socket lives until the answer.
  boost::asio::awaitable<Outcome> secure(StreamSocket& socket, const char* port);

  // For handshakes that begin from now on; connections keep what they have.
  void use(std::shared_ptr<const TlsContext> context) { context_ = std::move(context); }
  const TlsContext& context() const { return *context_; }
  const TlsCounters& counters() const { return counters_; }

 private:
  struct End {
    Outcome outcome = Outcome::secure;
    std::string failure;
  };

  boost::asio::awaitable<End> shake_hands(StreamSocket& socket);
  void log_failure(const std::string& peer, const char* port, const std::string& why);

  runtime::Clock& clock_;
  runtime::WorkerThread& worker_;
  std::shared_ptr<const TlsContext> context_;
  TlsCounters counters_;
  runtime::SparseLines lines_;
};

}  // namespace server::tls
