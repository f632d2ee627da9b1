// Limits that the system sets to a program, and those that are too tight for a station.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/config/config.hpp"

namespace server::config {

// None: unlimited.
struct ResourceLimits {
  std::optional<std::uint64_t> file_bytes;  // of each file
  std::optional<std::uint64_t> cpu_s;  // of computing, in all: the hard limit, for the signal of the other is ignored
  std::optional<std::uint64_t> address_bytes;  // of memory
  std::optional<std::uint64_t> stack_bytes;    // of each thread
  std::optional<std::uint64_t> open_files;     // up to which the station may raise it
};

ResourceLimits own_limits();
// Of a process, as /proc says; none: it is not there, or not readable.
std::optional<ResourceLimits> limits_of(int pid);
ResourceLimits parse_limits(const std::string& text);  // of /proc/PID/limits; what is not there is unlimited

std::uint64_t needed_open_files(const Config& config);

struct TightLimit {
  std::string what, action;  // in words
};
std::vector<TightLimit> tight_limits(const ResourceLimits& limits, const Config& config);

}  // namespace server::config
