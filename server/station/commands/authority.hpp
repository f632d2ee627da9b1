// Who may command which robot: control is a lease that one actor holds, and that one client of it keeps alive.
//
// An actor is a session of a page ("session:3") or a token ("token:local"). An actor that commands a robot without a
// holder becomes its holder; the client that commanded last, or took control, is the one whose signs of life count.
// While a reservation keeps an actor out they neither get nor have control, unless an administrator took it by force.
// An emergency stop is never checked here. Loop thread; only keeps the leases: the station reports changes.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/ended_right.hpp"
#include "server/runtime/result.hpp"
#include "server/station/commands/client.hpp"
#include "server/station/commands/requests.hpp"
#include "server/station/commands/reservations.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

inline constexpr microseconds kRequestTimeout{30'000'000};  // of a request for control

class Authority {
 public:
  // A change of who holds control, in words for the log of the robot.
  struct Change {
    RobotId robot_id;
    std::string kind;   // control_taken, control_released, control_expired, control_forced, control_handed_over, …
    std::string cause;  // who, from whom, why
  };

  // Both outlive it.
  Authority(runtime::Clock& clock, const Reservations& reservations) : clock_{clock}, reservations_{reservations} {}

  // Who holds control now; no holder: nobody.
  ControlState of(const RobotId& robot) const;

  // Whether a command of the actor would be let through; conflict when another holds control, or has reserved the robot
  // (reason "reserved"). So do all below but force and release.
  Result<void> may_use(const RobotId& robot, const std::string& actor) const;

  // For a command of the client, which `steers` or does not: control is its own afterwards, at least for kControlLease.
  // conflict when another holds it.
  Result<std::optional<Change>> use(const RobotId& robot, const Client& client, bool steers = true);

  // `duration`: how long the lease lasts without a keep_alive(). A page calls that several times a second.
  Result<std::optional<Change>> take(const RobotId& robot, const Client& client, microseconds duration);
  // From its present holder. The API lets only an admin do this; the reason is kept.
  Change take_by_force(const RobotId& robot, const Client& client, const std::string& reason);
  Result<Change> release(const RobotId& robot, const std::string& actor);
  // Asks the holder for it. conflict when nobody holds it: take it.
  Result<Change> request(const RobotId& robot, const Client& client);
  // To the actor that requested it.
  Result<Change> hand_over(const RobotId& robot, const std::string& actor);

  // The first reservation that keeps the actor out of the robot between now and so much later; null: none, or they
  // control the robot by force.
  const Reservation* keeps_out(const RobotId& robot, const std::string& actor, microseconds ahead) const;

  // The holder, and which client of theirs keeps control; no actor: nobody.
  Client client_of(const RobotId& robot) const;
  // Whether that is this client, or nobody.
  bool is_kept_by(const RobotId& robot, const Client& client) const;

  // Extends the lease of the robot to its duration from now, if the client keeps it.
  void keep_alive(const RobotId& robot, const Client& client);
  // Every lease that the client keeps: of one that says no robot, and has no id.
  void keep_all_alive(const Client& client);

  // What an actor whose right has ended holds, or has asked for, ends. None: they held nothing.
  std::optional<Change> end_right(const RobotId& robot, const runtime::EndedRight& right);

  // Ends what has ended, and returns it.
  std::vector<Change> expire();

 private:
  struct Lease {
    std::string holder;
    std::string client;            // its id
    std::int64_t taken_at_us = 0;  // UTC
    std::int64_t ends_us = 0;      // steady
    microseconds duration{0};
    Client requested_by;
    std::int64_t request_ends_us = 0;  // steady
    bool is_forced = false;            // no reservation ends it
  };

  bool is_live(const RobotId& robot, const Lease& lease) const;
  Result<void> check_reserved(const RobotId& robot, const std::string& actor) const;
  Lease* lease_of(const RobotId& robot);  // null when nobody holds it now
  Lease& give(const RobotId& robot, const Client& client, microseconds duration);
  void extend(const RobotId& robot, Lease& lease, const Client& client) const;
  Result<Lease*> own_lease(const RobotId& robot, const std::string& actor);

  runtime::Clock& clock_;
  const Reservations& reservations_;
  std::map<RobotId, Lease> leases_;  // of known robots only
};

}  // namespace server::station
