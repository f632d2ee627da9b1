// From the station's reports to the sessions of Foxglove clients: a sink of the station.
//
// A message is written once, for the first session that has subscribed to it, and shared by all. Samples that a robot
// sends later (backfill) are left out: clients take what arrives for what is now. Renewals of leases, some ten a second
// while somebody drives, are left out as well. Never waits for a client. Loop thread; outlives its sessions.
#pragma once

#include <map>
#include <vector>

#include "server/live/foxglove/session.hpp"
#include "server/station/state/station_sink.hpp"

namespace server::live::foxglove {

class Feed final : public station::StationSink {
 public:
  // The session gets the channels of these robots, and of those that come.
  void add(Session& session, const std::map<station::RobotId, station::RobotState>& robots);
  void remove(Session& session);

  void on_robot(const station::RobotState& robot) override;
  void on_samples(const station::RobotState& robot, const station::SampleBatch& batch) override;
  void on_event(const station::RobotState& robot, const station::RobotEvent& event) override;
  void on_command(const station::CommandRecord& record) override;
  bool watches(const station::RobotId& robot) const override;

  std::size_t sessions() const { return sessions_.size(); }

 private:
  struct Reader {
    Session* session;
    SubscriptionId subscription;
  };
  std::vector<Reader> readers_of(const station::RobotId& robot, Topic topic) const;

  std::vector<Session*> sessions_;
};

}  // namespace server::live::foxglove
