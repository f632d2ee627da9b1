// Settings of the configuration for experiments.
#pragma once

#include <cstdint>

namespace server::config {

struct ExperimentRules {
  // SAFETY: experiments.allow_unattended: experiments may go on while nobody is there, in auto alone
  bool allow_unattended = false;
  std::uint32_t back_within_s = 10;  // an interrupted one goes on by itself if robot and client are back by then
};

}  // namespace server::config
