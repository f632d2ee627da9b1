// Sends a fault to the fault server of a simulated robot that runs.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <string>

namespace sim_robot {

// POST /faults with this JSON. Throws std::runtime_error with the server's detail when it refuses the fault, and what
// went wrong when no answer comes within `time`.
void post_fault(const boost::asio::ip::tcp::endpoint& server, const std::string& json,
                std::chrono::milliseconds time = std::chrono::seconds{5});

}  // namespace sim_robot
