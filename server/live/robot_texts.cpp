// Compares, writes what differs, and cuts into pieces.
#include "server/live/robot_texts.hpp"

#include <utility>

#include "server/live/state_json.hpp"

namespace server::live {
namespace asio = boost::asio;

asio::awaitable<void> RobotTexts::wait_for_turn() {
  if (!turns_.take()) co_await turns_.wait();
}

RobotTexts::Piece RobotTexts::piece_after(const station::RobotId& id) {
  Piece piece;
  const std::uint64_t enough = written_ + kWrittenInAPiece;
  const auto& robots = station_.robots();
  auto robot = robots.upper_bound(id);
  for (; robot != robots.end() && piece.text.size() < kPieceBytes && written_ < enough; ++robot) {
    if (!piece.text.empty()) piece.text += ',';
    piece.text += text_of(robot->second);
    piece.last = robot->first;
  }
  piece.is_end = robot == robots.end();
  return piece;
}

const std::string& RobotTexts::text_of(const station::RobotState& robot) {
  Kept& kept = kept_[robot.id];
  if (kept.text.empty() || kept.state != robot) {
    kept.text = dump(to_json(robot));
    kept.state = robot;
    ++written_;
  }
  return kept.text;
}

asio::awaitable<std::string> RobotDocument::next() {
  co_await texts_.wait_for_turn();
  after_ = last_;
  const RobotTexts::Piece piece = texts_.piece_after(after_);
  std::string text = std::exchange(head_, {});
  if (!after_.empty()) text += ',';
  text += piece.text;
  last_ = piece.last;
  is_whole_ = piece.is_end;
  if (is_whole_) text += tail_;
  co_return text;
}

}  // namespace server::live
