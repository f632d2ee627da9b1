// The states of all robots as JSON text, made in pieces, so that a page of thousands of robots never blocks the loop.
//
// The text of a robot is kept, and written again only when its state has changed: an absent robot costs a comparison.
// Without readers nothing is written. A piece is a bounded amount of work, and each turn of the loop makes one, however
// many readers there are.
//
// Loop thread. The station outlives it; it outlives its readers. Why so: decision 0035.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <string>
#include <unordered_map>

#include "server/runtime/turns.hpp"
#include "server/station/station.hpp"

namespace server::live {

class RobotTexts {
 public:
  static constexpr std::size_t kPieceBytes = 32 * 1024;  // a piece ends with the robot that reaches it,
  static constexpr std::size_t kWrittenInAPiece = 8;     // or when this number of texts had to be written, 30 µs each

  struct Piece {
    std::string text;       // JSON objects with commas between them
    station::RobotId last;  // the last robot in it; empty: it has none
    bool is_end = false;    // no robot follows
  };

  RobotTexts(boost::asio::io_context& loop, const station::Station& station) : station_{station}, turns_{loop, 1} {}

  // Until a piece may be made; returns at once when none was made in this turn of the loop.
  boost::asio::awaitable<void> wait_for_turn();
  // The robots whose ids follow this one, in order, as their states are now; empty: from the first.
  Piece piece_after(const station::RobotId& id);

  std::uint64_t written() const { return written_; }  // texts, so far

 private:
  struct Kept {
    station::RobotState state;
    std::string text;
  };
  const std::string& text_of(const station::RobotState& robot);

  const station::Station& station_;
  runtime::Turns turns_;
  std::unordered_map<station::RobotId, Kept> kept_;  // of those that somebody has read
  std::uint64_t written_ = 0;
};

// One reader's way through all robots: a JSON document that has them in its middle.
class RobotDocument {
 public:
  // `head` ends with the opening bracket of the list, `tail` begins with the closing one.
  RobotDocument(RobotTexts& texts, std::string head, std::string tail)
      : texts_{texts}, head_{std::move(head)}, tail_{std::move(tail)} {}

  // The next piece, which is never empty. A robot that appears meanwhile behind those that were read is left out.
  boost::asio::awaitable<std::string> next();
  bool is_whole() const { return is_whole_; }

  // The robots in the latest piece are those whose ids follow the first of these, up to the second.
  const station::RobotId& after() const { return after_; }
  const station::RobotId& last() const { return last_; }

 private:
  RobotTexts& texts_;
  std::string head_, tail_;
  station::RobotId after_, last_;
  bool is_whole_ = false;
};

}  // namespace server::live
