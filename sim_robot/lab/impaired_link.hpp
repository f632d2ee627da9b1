// A bad network between a robot that dials and a station that listens, in virtual time, 10 ms a step.
//
// Both directions of each connection pass through an ImpairedStream. The robot's side does what
// sim_robot/client/robot_client does over sockets: it dials for ever, closes a connection that is silent for the link
// time-out, and never waits for the network. A robot with a handshake dials only at rest, and its loop stands still
// until the handshake is over. The faults and what must come of them: docs/network_faults.md.
#pragma once

#include <optional>
#include <random>
#include <vector>

#include "sim_robot/faults/faulty_robot.hpp"
#include "sim_robot/network/redial.hpp"
#include "sim_robot/robot/robot_life.hpp"

namespace sim_robot {

struct LinkOptions {
  Impairment up, down;     // robot to station, station to robot
  double handshake_s = 0;  // TLS, 1 to 5 s on the robot's board; 0: none
  std::uint64_t seed = 1;  // of jitter, loss and the pauses between two attempts to dial
};

class ImpairedLink final : public FaultyLink {
 public:
  static constexpr std::uint64_t kStepUs = SimulatedRobot::kPeriodUs;

  explicit ImpairedLink(RobotLife& robot, const LinkOptions& options = {});

  // True time passes: exchange(), the robot's ticks, exchange().
  void step();
  // What is due at the robot's end: it dials, reads and writes.
  void exchange();
  std::uint64_t now_us() const { return robot_.true_us(); }

  // The station's end, of the connection that reached it last.
  int connections() const { return connections_; }  // a new number is a new connection
  bool is_open() const { return connection_ && connection_->station_is_open; }
  std::size_t send(protocol::Bytes bytes);  // takes what fits
  std::size_t receive(std::uint8_t* out, std::size_t capacity);
  void close();

  // The faults. An outage takes every connection and every attempt to dial; the others take the one connection.
  void outage(double for_s, bool then_reset = false) override;
  void half_open(Direction direction = Direction::both) override;
  void resume() override;
  void cut(std::size_t after_bytes = SIZE_MAX) override;
  void reset() override;
  void impair(const Impairment& up, const Impairment& down) override;
  const LinkImpairments& impairments() const override { return impairments_; }
  const LinkImpairments& made_with() const override { return made_with_; }

  bool robot_is_connected() const { return phase_ == Phase::open; }
  RobotLife& robot() { return robot_; }

 private:
  enum class Phase { idle, dialling, handshake, open };
  struct Connection {
    ImpairedStream up, down;
    bool station_is_open = true;
  };

  void follow_reboot();
  void end_outage();
  void dial();
  void open();
  void read();
  void write();
  void hang_up(bool says_so);
  void answer_the_dead();
  void pause_for_at_least(std::uint64_t duration_us);

  RobotLife& robot_;
  const LinkImpairments made_with_;
  LinkImpairments impairments_;
  const double handshake_s_;
  std::mt19937_64 random_;
  Redial redial_;
  Phase phase_ = Phase::idle;
  std::uint64_t phase_ends_us_ = 0;  // when it dials, or when the connection is there
  std::optional<Connection> connection_;
  std::vector<std::uint8_t> unsent_;  // the rest of the robot's frame under way
  int connections_ = 0;
  int boots_;
  std::uint64_t outage_until_us_ = 0;
  bool reset_after_outage_ = false;
};

}  // namespace sim_robot
