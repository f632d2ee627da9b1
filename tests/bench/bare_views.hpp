// The pages of the bare loop: the least that shows a robot's samples live, in the words of the station's /live.
#pragma once

#include <sys/socket.h>

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace bare {

// Of one robot: who watches it, and the columns of the samples that they have not got yet.
struct View {
  static constexpr std::array<const char*, 6> kNames{"position_m", "velocity_m_s", "acceleration_m_s2",
                                                     "duty",       "impedance_mv", "reference_m"};
  static constexpr int kGathered = 5;

  std::vector<int> pages;
  std::array<std::string, kNames.size()> columns;
  int gathered = 0;
};

// Believes everything: one read is one message, a page watches one robot, and its socket takes all that it is sent.
class ViewDesk {
 public:
  View* view_of(const std::string& robot) { return &views_[robot]; }

  // True when the text is a page's: its handshake, or what it says.
  bool take(int fd, std::string_view text) {
    if (text.starts_with("GET /live")) {
      say(fd, "HTTP/1.1 101 Switching Protocols\r\n\r\n");
      pages_.insert(fd);
      return true;
    }
    if (!pages_.contains(fd)) return false;
    const std::size_t begin = text.find("[\"");
    if (begin != std::string_view::npos) {
      views_[std::string{text.substr(begin + 2, text.find('"', begin + 2) - begin - 2)}].pages.push_back(fd);
    }
    return true;
  }

  static void add(View& view, std::size_t channel, float value) {
    char digits[32];
    char* end = digits;
    if (std::isfinite(value)) end = std::to_chars(digits, digits + sizeof digits, value).ptr;
    std::string& column = view.columns[channel];
    column.append(column.empty() ? "" : ",").append(std::isfinite(value) ? std::string_view{digits, end} : "null");
  }

  // After each sample.
  void sample_is_whole(View& view, const std::string& robot, std::uint64_t seq) {
    if (++view.gathered < View::kGathered) return;
    message_ = R"({"type":"samples","robot_id":")" + robot + R"(","first_seq":)" +
               std::to_string(seq + 1 - static_cast<std::uint64_t>(view.gathered));
    for (std::size_t i = 0; i < View::kNames.size(); ++i) {
      message_.append(",\"").append(View::kNames[i]).append("\":[").append(view.columns[i]).append("]");
      view.columns[i].clear();
    }
    view.gathered = 0;
    send_to(view.pages);
  }

  void stamp(std::int64_t now_us) {
    if (pages_.empty() || now_us - stamped_us_ < 100'000) return;
    stamped_us_ = now_us;
    message_ = R"({"type":"stamp","stamp_us":)" + std::to_string(now_us);
    send_to(pages_);
  }

 private:
  static void say(int fd, std::string_view text) { send(fd, text.data(), text.size(), MSG_NOSIGNAL); }

  void send_to(const auto& pages) {
    message_ += '}';
    std::string frame{"\x81", 1};
    if (message_.size() < 126) {
      frame += static_cast<char>(message_.size());
    } else {
      frame += {126, static_cast<char>(message_.size() >> 8), static_cast<char>(message_.size() & 0xFF)};
    }
    frame += message_;
    for (const int fd : pages) say(fd, frame);
  }

  std::map<std::string, View> views_;
  std::set<int> pages_;
  std::string message_;
  std::int64_t stamped_us_ = 0;
};

}  // namespace bare
