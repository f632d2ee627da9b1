// Steps the lab, hears its events once, and does faults to it.
#include "tests/sim_robot/story.hpp"

#include <algorithm>

namespace sim_robot {
namespace {

constexpr std::uint64_t kUnderWay = 100;  // samples, on a slow link

}  // namespace

void Story::begin(Setting setting, Where where) {
  forget();
  events_heard_ = 0;
  known_events_.clear();
  lab_ = std::make_unique<Lab>(std::move(setting.robot), setting.link, std::move(setting.faults));
  station().welcome.samples_per_frame = setting.samples_per_frame;
  constexpr double kPatienceS = 10;
  while (station().samples.empty()) {
    if (lab_->time_s() > kPatienceS) fail("awaited for 10 s: the first sample", "none came", where);
    step();
  }
}

void Story::suffer(const Fault& fault) { lab_->faults.inject(fault, lab_->faulty()); }

void Story::outage(double for_s) { suffer({.kind = FaultKind::link_outage, .for_s = for_s}); }

void Story::impair_link(const Impairment& both_ways) { link().impair(both_ways, both_ways); }

void Story::reboot(const Reboot& reboot) { robot().reboot(reboot); }

void Story::expect_whole(Where where) {
  pass(2.5);  // the last batch, and a status
  const auto& samples = station().samples;
  const std::uint64_t made = samples.empty() ? 0 : samples.rbegin()->first + 1;
  const bool is_current = station().link_is_up() && made + kUnderWay >= lab_->core().samples().next_seq();
  const bool is_whole = is_current && made > 0 && samples.size() == made && station().durable_next_seq() == made &&
                        station().lost_samples() == 0 && status().lost_samples == 0;
  if (is_whole) return;
  fail("expected: no sample lost",
       (is_current ? "of " : "the newest are missing, of ") + std::to_string(made) + " samples " +
           std::to_string(samples.size()) + " arrived, lost are " + std::to_string(station().lost_samples()) +
           ", by the robot's count " + std::to_string(status().lost_samples),
       where);
}

protocol::Status Story::status() const {
  const auto& frames = lab_->station.frames;
  const auto newest = std::find_if(frames.rbegin(), frames.rend(), [](const protocol::RobotFrame& frame) {
    return frame.which_body == rheonaut_RobotFrame_status_tag;
  });
  return newest == frames.rend() ? protocol::Status(rheonaut_Status_init_zero) : newest->body.status;
}

Moment Story::moment() const {
  const LinkedPeer& station = lab_->station;
  const std::uint64_t heard_of = station.samples.empty() ? 1 : station.samples.rbegin()->first + 1;
  const std::uint64_t made = std::max(heard_of, station.hello ? station.hello->next_seq : 0);
  return {lab_->time_s(), received(), true_view(lab_->robot.robot()), lab_->link.connections(),
          made - station.durable_next_seq()};
}

// After a reboot the newest sample is that of the boot before, but for what Hello has said.
View Story::received() const {
  const LinkedPeer& station = lab_->station;
  View view;
  view.link = station.link_is_lost() ? LinkView::lost : station.link_is_up() ? LinkView::up : LinkView::none;
  const bool is_new_boot = station.samples.empty() && !station.earlier_boots.empty();
  const auto& samples = is_new_boot ? station.earlier_boots.back() : station.samples;
  if (samples.empty()) return view;
  const ReceivedSample& newest = samples.rbegin()->second;
  view.position_m = static_cast<double>(newest.position_m);
  view.velocity_m_s = static_cast<double>(newest.velocity_m_s);
  view.duty = static_cast<double>(newest.duty);
  view.impedance_mv = static_cast<double>(newest.impedance_mv);
  view.mode = is_new_boot && station.hello ? station.hello->mode : newest.mode;
  view.emergency_id = is_new_boot && station.hello ? station.hello->emergency_id : newest.emergency_id;
  if (is_new_boot) return view;
  view.sub_state = newest.sub_state;
  if (newest.setpoint_m) view.setpoint_m = static_cast<double>(*newest.setpoint_m);
  view.flags = newest.flags;
  return view;
}

void Story::step() {
  lab_->step();
  hear_news();
}

void Story::hear_news() {
  const auto& events = lab_->station.events;
  for (; events_heard_ < events.size(); ++events_heard_) {
    const protocol::Event& event = events[events_heard_];
    const std::size_t boot = lab_->station.earlier_boots.size();
    if (!known_events_.insert({boot, event.event_seq, event.event_robot_time_us}).second) continue;
    receive({protocol::text(event.kind), protocol::text(event.cause),
             1e-6 * static_cast<double>(event.event_robot_time_us), static_cast<double>(event.position_m),
             static_cast<double>(event.value), event.emergency_id});
  }
}

std::uint64_t Story::give(const protocol::Command& command) { return station().send(command); }

std::optional<Answer> Story::answer_to(std::uint64_t command_id) const {
  const auto ack = lab_->station.ack_of(command_id);
  if (!ack) return std::nullopt;
  const bool is_rejected = ack->result == rheonaut_COMMAND_RESULT_REJECTED;
  return Answer{is_rejected ? protocol::text(ack->reason) : protocol::text(ack->result), ack->emergency_id,
                ack->effect_at_robot_us};
}

}  // namespace sim_robot
