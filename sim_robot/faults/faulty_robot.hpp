// What faults act on: a robot over its boots, and the network between it and its station.
#pragma once

#include <cstddef>

#include "sim_robot/network/impairment.hpp"

namespace sim_robot {

class RobotLife;

enum class Direction { up, down, both };  // up: robot to station; down: station to robot

struct LinkImpairments {
  Impairment up, down;
};

// A network that can be broken: ImpairedLink in virtual time, Proxy over sockets.
class FaultyLink {
 public:
  // Nothing passes and nobody is reached, until it is over or resume(). When it is over by itself, what waits comes
  // with the first retransmission that gets through, or every connection is reset.
  virtual void outage(double for_s, bool then_reset) = 0;
  // The connections there are take bytes and say nothing, until resume(); new ones are well.
  virtual void half_open(Direction direction) = 0;
  // Ends outage and half-open; what waits comes at once.
  virtual void resume() = 0;
  virtual void cut(std::size_t after_bytes) = 0;  // the end behind so many of the bytes under way
  virtual void reset() = 0;                       // the end at once, and nothing of them
  // For bytes from now on.
  virtual void impair(const Impairment& up, const Impairment& down) = 0;

  virtual const LinkImpairments& impairments() const = 0;
  virtual const LinkImpairments& made_with() const = 0;  // in the beginning

 protected:
  ~FaultyLink() = default;
};

struct FaultyRobot {
  RobotLife& life;
  FaultyLink* link;  // null: this run has no network of its own to break
};

}  // namespace sim_robot
