// The station's log: lines to standard error, through spdlog.
#pragma once

#include <string>

namespace server {

// `level` is trace, debug, info, warn or error.
void start_log(const std::string& level);

}  // namespace server
