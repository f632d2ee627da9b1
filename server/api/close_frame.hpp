// The last frame of a WebSocket that the station ends: a code of RFC 6455, section 7.4.1, and a sentence why.
//
// It is written at once or not at all, so a connection can end with it though the loop is about to stop. A client that
// ends the connection itself, or sends what is no WebSocket message or too long a one, is answered by Beast.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "server/api/peer_watch.hpp"
#include "server/http/http_stream.hpp"

namespace server::api {

enum class CloseCode : std::uint16_t {
  going_away = 1001,        // the station stops
  policy_violation = 1008,  // signed out, or silent
  internal_error = 1011,
  try_again_later = 1013,  // read too slowly
};

struct Closing {
  CloseCode code = CloseCode::going_away;
  std::string_view reason = "the station stops";  // at most 123 bytes
};

inline constexpr Closing kSignedOut{CloseCode::policy_violation,
                                    "signed out: the credential was revoked, has expired or has other rights now"};
inline constexpr Closing kSilent{CloseCode::policy_violation, "silent for 30 s, pings included"};
inline constexpr Closing kTooSlow{CloseCode::try_again_later, "read too slowly: a message that must arrive was lost"};
inline constexpr Closing kFault{CloseCode::internal_error, "a fault in the station; its log says more"};

inline std::string close_frame(const Closing& closing) {
  const auto code = static_cast<std::uint16_t>(closing.code);
  std::string frame{static_cast<char>(0x88), static_cast<char>(2 + closing.reason.size()),
                    static_cast<char>(code >> 8U), static_cast<char>(code & 0xffU)};
  return frame.append(closing.reason);
}

// Not into the middle of a message that is being written, nor behind one that was cut off.
inline void write_close_frame(http::HttpStream& stream, const PeerWatch& peer, const Closing& closing) {
  if (!peer.is_writing()) stream.write_now(close_frame(closing));
}

}  // namespace server::api
