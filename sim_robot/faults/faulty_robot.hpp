// The targets of faults: a robot over its boots, and the network between it and its station.
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
  // Nothing passes and no connection is made, until the outage ends or resume(). When it ends by itself, waiting bytes
  // come with the first retransmission that gets through, or every connection is reset.
  virtual void outage(double for_s, bool then_reset) = 0;
  // Present connections take bytes and deliver nothing, until resume(); new ones work.
  virtual void half_open(Direction direction) = 0;
  // Ends outage and half-open; waiting bytes come at once.
  virtual void resume() = 0;
  virtual void cut(std::size_t after_bytes) = 0;  // the end behind this number of the bytes under way
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
  FaultyLink* link;  // null: this run has no network of its own
};

}  // namespace sim_robot
