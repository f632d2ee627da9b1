// Sets up spdlog.
#include "server/runtime/log.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

namespace server::runtime {

void start_log(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("rheonaut"));
  spdlog::set_level(spdlog::level::from_str(level));
  spdlog::set_pattern("%Y-%m-%d %H:%M:%S.%e  %^%-7l%$  %v");
}

std::string and_before(std::uint64_t unsaid) { return unsaid == 0 ? "" : fmt::format(" (and {} before)", unsaid); }

}  // namespace server::runtime
