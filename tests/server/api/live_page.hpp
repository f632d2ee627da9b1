// A page on /live, or another WebSocket, with WebSocket frames made by hand.
#pragma once

#include <functional>

#include "tests/server/api/api_fixture.hpp"

namespace server {

// A page: the handshake, then text frames.
class Page {
 public:
  // `meanwhile` is called once it is connected: what it begins happens while the page opens.
  Page(
      VirtualClock& clock, std::uint16_t port, const std::string& headers, const char* from = "127.0.0.1",
      const std::function<void()>& meanwhile = [] {}, const std::string& target = "/live")
      : client_{clock, port, from} {
    meanwhile();
    client_.send("GET " + target +
                 " HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                 "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
                 headers + "\r\n");
    answer = client_.read_until("\r\n\r\n");
  }

  bool open() const { return answer.starts_with("HTTP/1.1 101 "); }

  void say(const json& message) { say_text(message.dump()); }
  void say_text(const std::string& text) { send_frame('\x81', text); }

  // The next message of this type; others are passed over, pings are answered when `answers_pings`.
  json receive(const std::string& type) {
    for (int i = 0; i < 1000; ++i) {
      const auto text = next_message();
      if (!text) return nullptr;
      json message = json::parse(*text);
      if (message["type"] == type) return message;
    }
    return nullptr;
  }

  void say_bytes(const std::string& bytes) { send_frame('\x82', bytes); }

  // Of text or bytes; none: it was closed.
  std::optional<std::string> next_text() { return next_message(); }

  // The next message, of whatever type; null when none comes.
  json next() {
    const auto text = next_message();
    return text ? json::parse(*text) : json();
  }

  bool closed() { return client_.closed(); }
  RawClient& client() { return client_; }

  std::string answer;
  int pings = 0;
  int close_code = 0;  // 0: the station has sent none
  bool answers_pings = true;

 private:
  void send_frame(char first, const std::string& payload) {
    std::string frame{first};
    if (payload.size() < 126) {
      frame += static_cast<char>(0x80U | payload.size());
    } else {
      frame += '\xfe';
      frame += static_cast<char>(payload.size() >> 8U);
      frame += static_cast<char>(payload.size() & 0xffU);
    }
    client_.send(frame + std::string(4, '\0') + payload);  // a mask of zeros
  }

  std::optional<std::string> next_message() {
    std::string message;  // of several frames, perhaps
    for (;;) {
      const std::string head = client_.read_exactly(2);
      if (head.size() < 2) return std::nullopt;
      std::size_t size = static_cast<unsigned char>(head[1]) & 0x7fU;
      if (size >= 126) {
        std::size_t extended = 0;
        for (const char c : client_.read_exactly(size == 126 ? 2 : 8)) {
          extended = extended * 256 + static_cast<unsigned char>(c);
        }
        size = extended;
      }
      const std::string payload = client_.read_exactly(size);
      if (head[0] == '\x88') {
        close_code = static_cast<unsigned char>(payload.at(0)) * 256 + static_cast<unsigned char>(payload.at(1));
        return std::nullopt;
      }
      if (head[0] == '\x89') {
        ++pings;
        if (answers_pings) send_frame('\x8a', payload);
        continue;
      }
      message += payload;
      const bool is_last_frame = (static_cast<unsigned char>(head[0]) & 0x80U) != 0;
      if (is_last_frame) return message;
    }
  }

  RawClient client_;
};

}  // namespace server
