// The frames of the story's robots.
#pragma once

#include <cstdint>
#include <string>

#include "tests/server/link/test_robot.hpp"

namespace server {

inline constexpr std::uint64_t kFirstSampleUs = 5'000'000;  // robot time of sample 0

protocol::RobotFrame hello_of(const std::string& id, std::uint64_t boot_id);
// Of a swimmer in manual; later frames change of it what they need.
protocol::RobotFrame samples_of(std::uint64_t first_seq, pb_size_t count);
// Channels at the ends of float32: denormal, largest, no number, infinite, negative zero.
protocol::RobotFrame extreme_samples(std::uint64_t first_seq);
protocol::RobotFrame event_of(std::uint64_t event_seq, protocol::EventKind kind, protocol::EventCause cause);
// Two parameters whose limits are those of float32, one page.
protocol::RobotFrame parameters();
protocol::RobotFrame controller();
protocol::RobotFrame status();

}  // namespace server
