// The connection to the station: Wi-Fi, then TCP and TLS, dialled again for ever.
//
//   off --begin--> joining --joined--> ready --dialled--> open
//   open --lost or closed--> ready; from any state, Wi-Fi gone --> off
// Blocking calls (the handshake takes seconds, joining and closing up to 0.3 s) are made only when the caller reports
// that the robot is at rest; nothing else here waits. Without an answer, reaching the station ends after 2 s, the
// handshake after 8 s. After a failure the next attempt waits 0.1 to 0.6 s, while the ring has room. With a full ring
// pauses grow to eight times as long. TLS 1.2 with the station's key pinned and records of at most 512 bytes, both
// ways.
#pragma once

#include "protocol/bytes.hpp"
#include "robot_fw/esp8266/robot_secrets.hpp"
#include "robot_fw/esp8266/tls_stream.hpp"
#include "robot_fw/esp8266/wide_clock.hpp"

namespace robot_fw::esp8266 {

class StationLink {
 public:
  enum class State { off, joining, ready, open };

  StationLink(const Secrets& secrets, WideClock& clock);

  // Turns the radio on; joins nothing yet.
  void begin();
  // One step onwards. True when a connection was opened in it.
  bool step(bool at_rest, bool ring_has_room);
  // Gives the connection up. The socket itself is closed at the next step at rest.
  void close();

  State state() const { return state_; }
  // False when the key in the secrets is none: nothing is joined and nobody dialled then.
  bool key_is_sound() const { return key_is_sound_; }
  // False once the peer or the Wi-Fi is gone.
  bool alive();
  // Takes what has come, at most `capacity` bytes; 0 when nothing has.
  std::size_t read(std::uint8_t* bytes, std::size_t capacity);
  // How large a frame may be that write() hands to TCP at once; 0 for none.
  std::size_t room();
  // One frame, in one write; it must not be larger than room(). False when it did not go: the stream is broken then.
  // Its last record may wait in TLS while TCP is out of memory; room() is 0 until that has gone.
  bool write(protocol::Bytes frame);
  // The station has welcomed the robot: the next loss is dialled after the shortest pause again.
  void welcomed() { failures_ = 0; }
  std::int32_t rssi_dbm() const;

 private:
  void join();
  void wait_for_wifi();
  bool dial();
  bool handshake();
  bool reach_station();
  void pause_after_failure();

  const Secrets& secrets_;
  WideClock& clock_;
  BearSSL::PublicKey station_key_;
  bool key_is_sound_;
  BearSSL::Session session_;  // a later handshake takes it up, which is faster
  TlsStream stream_;
  State state_ = State::off;
  bool socket_is_stale_ = false;
  std::uint64_t next_attempt_at_us_ = 0, join_until_us_ = 0;
  bool ring_has_room_ = true;
  std::uint32_t failures_ = 0;           // in a row, with a full ring
  std::size_t empty_buffer_ = 0;         // what TCP takes when nothing is under way
  std::uint32_t records_under_way_ = 0;  // since it was empty
};

}  // namespace robot_fw::esp8266
