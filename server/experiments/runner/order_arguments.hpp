// The arguments of a runner's command as JSON, for its record: as the body of such a command has them.
#pragma once

#include <string>

#include "protocol/messages.hpp"

namespace server::experiments {

std::string arguments_of(const protocol::Command& command);

}  // namespace server::experiments
