// Sets up spdlog: one line an entry in either format, whatever a robot's name or a text of a peer contains.
#include "server/runtime/log.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cstdlib>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>

namespace server::runtime {
namespace {

// Two bytes of UTF-8 that are a control character of C1, which terminals obey as they obey an escape.
bool is_c1(std::string_view text, std::size_t at) {
  if (text[at] != '\xc2' || at + 1 == text.size()) return false;
  const auto next = static_cast<unsigned char>(text[at + 1]);
  return next >= 0x80 && next < 0xa0;
}

// SAFETY: the message with every control character written out: no text of a peer can begin a line of its own, or
// command the terminal of a person who reads the log.
class OneLine final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& entry, const std::tm&, spdlog::memory_buf_t& out) override {
    const std::string_view text{entry.payload.data(), entry.payload.size()};
    for (std::size_t at = 0; at < text.size(); ++at) {
      const auto byte = static_cast<unsigned char>(text[at]);
      if (byte == '\n') {
        out.append(std::string_view{"\\n"});
      } else if (byte < 0x20 || byte == 0x7f || is_c1(text, at)) {
        fmt::format_to(std::back_inserter(out), "\\x{:02x}", byte);
      } else {
        out.push_back(text[at]);
      }
    }
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<OneLine>(); }
};

// {"time":"2026-11-26T13:24:49.123456Z","level":"info","thread":4711,"message":"…"}, in ASCII
class JsonLines final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& entry, spdlog::memory_buf_t& out) override {
    const auto since_1970 = std::chrono::duration_cast<std::chrono::microseconds>(entry.time.time_since_epoch());
    const std::time_t seconds = std::chrono::floor<std::chrono::seconds>(since_1970).count();
    const auto level = spdlog::level::to_string_view(entry.level);
    const nlohmann::ordered_json line{
        {"time", fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:06}Z", fmt::gmtime(seconds), since_1970.count() % 1'000'000)},
        {"level", std::string_view{level.data(), level.size()}},
        {"thread", entry.thread_id},
        {"message", std::string_view{entry.payload.data(), entry.payload.size()}}};
    constexpr auto kReplace = nlohmann::ordered_json::error_handler_t::replace;
    out.append(line.dump(-1, ' ', true, kReplace) + '\n');
  }
  std::unique_ptr<formatter> clone() const override { return std::make_unique<JsonLines>(); }
};

}  // namespace

std::unique_ptr<spdlog::formatter> log_formatter(const std::string& format) {
  if (format == "json") return std::make_unique<JsonLines>();
  auto text = std::make_unique<spdlog::pattern_formatter>();
  text->add_flag<OneLine>('*').set_pattern("%Y-%m-%d %H:%M:%S.%e %z  %^%-7l%$  %*");
  return text;
}

void start_log(const std::string& level, const std::string& format) {
  const char* none = std::getenv("NO_COLOR");  // https://no-color.org
  const bool may_colour = none == nullptr || *none == '\0';
  spdlog::set_default_logger(
      spdlog::stderr_color_mt("rheonaut", may_colour ? spdlog::color_mode::automatic : spdlog::color_mode::never));
  spdlog::set_level(spdlog::level::from_str(level));
  spdlog::set_formatter(log_formatter(format));
}

std::string and_before(std::uint64_t unsaid) { return unsaid == 0 ? "" : fmt::format(" (and {} before)", unsaid); }

}  // namespace server::runtime
