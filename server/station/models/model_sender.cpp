// One coroutine for each robot that something is sent to; run() for what robots report by themselves.
#include "server/station/models/model_sender.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <utility>
#include <variant>

#include "server/station/models/confirmation_judgement.hpp"
#include "server/station/models/model_exchange.hpp"
#include "server/station/models/model_report.hpp"
#include "server/station/models/parameter_match.hpp"

namespace server::station {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kDebtInterval = 1s;
const Author kOfTheStation{"station:model", "", 0};

bool is_confirmed(std::uint32_t flags) { return (flags & rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED) != 0; }

}  // namespace

// A robot of the station, for an exchange. The sender's entries and the station's robots stay where they are.
class ModelSender::StationRobot final : public ModelRobot {
 public:
  StationRobot(Station& station, RobotId id, const Entry& entry)
      : station_{station}, id_{std::move(id)}, entry_{entry} {}

  const RobotState& state() const override { return *station_.find(id_); }
  const ParameterTable& parameters() const override { return station_.settings(id_)->parameters; }
  std::optional<bool> confirmation() const override { return entry_.seen.flag(); }
  std::uint64_t latest_naming() const override { return entry_.naming.number; }
  asio::awaitable<Result<CommandRecord>> submit(CommandRequest request) override {
    return station_.submit(std::move(request));
  }

 private:
  Station& station_;
  const RobotId id_;
  const Entry& entry_;
};

ModelSender::ModelSender(asio::io_context& loop, runtime::TaskGroup& tasks, runtime::Clock& clock, Station& station,
                         const FluidModelList& models)
    : loop_{loop}, tasks_{tasks}, clock_{clock}, station_{station}, models_{models}, wake_{loop_} {
  station.add_sink(*this);
  station.set_on_model_wanted([this](const RobotState& robot, const Author& by, std::optional<FluidModel> own) {
    on_model_wanted(robot, by, std::move(own));
  });
  tasks.spawn("models of fluids", run());
}

const FluidModel* ModelSender::own_model(const RobotState& robot, const Entry& entry) const {
  const FluidNaming& naming = entry.naming;
  const bool is_of_now = naming.fluid == robot.fluid && naming.boot_id == robot.boot_id;
  if (!naming.own_beside_us || !naming.model || !is_of_now) return nullptr;
  const FluidModel* listed = models_.find(robot.fluid);
  return listed != nullptr && listed->set_at_us != *naming.own_beside_us ? nullptr : &*naming.model;
}

// SAFETY: what was confirmed for another fluid is owed from here on, whatever becomes of the new model.
void ModelSender::on_model_wanted(const RobotState& robot, const Author& by, std::optional<FluidModel> own) {
  Entry& entry = entries_[robot.id];
  if (const FluidModel* before = own_model(robot, entry); before != nullptr && !own) own = *before;
  const FluidModel* listed = models_.find(robot.fluid);
  const FluidModel* model = own ? &*own : listed;
  const std::optional<bool> flag = entry.seen.flag();
  const bool is_connected = robot.link == LinkState::connected;
  const bool is_in_sight = is_connected && entry.seen.boot_id() == robot.boot_id && flag && !entry.is_at_work;
  const bool may_be_confirmed = robot.boot_id != 0 && (!is_in_sight || *flag);
  const bool is_this = is_in_sight && *flag && robot.model.state == ModelState::confirmed &&
                       robot.model.fluid == robot.fluid && !robot.fluid.empty();
  entry.naming = {entry.naming.number + 1,
                  by,
                  robot.boot_id,
                  robot.fluid,
                  model == nullptr ? std::nullopt : std::optional{*model},
                  {}};
  if (own) entry.naming.own_beside_us = listed == nullptr ? 0 : listed->set_at_us;
  const bool is_confirmed_model = model != nullptr && model->is_confirmed();
  if (is_confirmed_model && is_this && holds(station_.settings(robot.id)->parameters, *model)) {
    return station_.set_model(robot.id, confirmed_model(entry.naming));  // own, or the list's: which of them may differ
  }
  const bool is_to_be_taken_back = !is_confirmed_model || !is_this;
  entry.owes = entry.owes || (may_be_confirmed && is_to_be_taken_back);
  if (entry.owes) open_.insert(robot.id);
  wake_.notify();
  if (model == nullptr && !entry.is_at_work && (!entry.owes || !is_in_sight)) {
    // run() settles the debt when telemetry comes
    return station_.set_model(robot.id, unsent_model(models_, robot.fluid));
  }
  if (is_connected) return begin(robot.id, entry);
  const FluidNaming naming = entry.naming;
  conclude(robot.id, naming,
           fail(ErrorCode::not_connected, "the robot was not connected; name the fluid again", "not_connected"));
}

void ModelSender::begin(const RobotId& id, Entry& entry) {
  station_.set_model(id, model_on_its_way(entry.naming));
  if (std::exchange(entry.is_at_work, true)) return;  // the task goes on with this naming
  tasks_.spawn("model of a robot's fluid", work(id));
}

asio::awaitable<void> ModelSender::work(RobotId id) {
  for (;;) {
    const FluidNaming naming = entries_[id].naming;
    Outcome outcome = fail(ErrorCode::internal, "a fault of the station; its log says which", "internal");
    auto sending = carry_out(id, naming, outcome);
    co_await alone(id, std::move(sending));
    Entry& entry = entries_[id];
    if (entry.naming.number != naming.number) continue;  // somebody has named another since
    entry.is_at_work = false;
    auto finishing = finish(id, naming, outcome);
    co_await alone(id, std::move(finishing));
    co_return;
  }
}

asio::awaitable<void> ModelSender::alone(RobotId id, asio::awaitable<void> task) {
  return contained(tasks_.exceptions(), clock_, runtime::Ended::model, fmt::format("the model of robot '{}'", id),
                   std::move(task));
}

// The outcome stays as it is when this fails inside.
asio::awaitable<void> ModelSender::carry_out(RobotId id, FluidNaming naming, Outcome& outcome) {
  StationRobot robot{station_, id, entries_[id]};
  ModelExchange exchange{clock_, robot, std::move(naming)};
  outcome = co_await exchange.run();
}

asio::awaitable<void> ModelSender::finish(RobotId id, FluidNaming naming, Outcome outcome) {
  conclude(id, naming, outcome);
  co_return;
}

void ModelSender::conclude(const RobotId& id, const FluidNaming& naming, const Outcome& outcome) {
  Entry& entry = entries_[id];
  entry.next_try_us = clock_.steady_us() + kRetryInterval.count();
  if (!outcome) return conclude_failure(id, naming, outcome.error());
  entry.owes = false;
  entry.reported_failure.clear();
  if (naming.model && !naming.model->is_confirmed()) {
    station_.set_model(id, model_held_as_assumed(naming));
    station_.note_model(id, "model_assumed", held_as_assumed_words(naming));
  } else if (naming.model) {
    station_.set_model(id, confirmed_model(naming));
    station_.note_model(id, "model_confirmed", confirmed_words(naming));
  } else {
    station_.set_model(id, unsent_model(models_, naming.fluid));
    station_.note_model(id, "model_taken_back", taken_back_words(naming));
  }
}

void ModelSender::conclude_failure(const RobotId& id, const FluidNaming& naming, const Error& error) {
  Entry& entry = entries_[id];
  if (error.reason == "booted") {  // follow() says so
    entry.owes = false;
    return;
  }
  // SAFETY: what was confirmed before is not this fluid's, and what was sent in part is nobody's.
  entry.owes = entry.owes || entry.seen.flag().value_or(true);
  if (entry.owes) open_.insert(id);
  wake_.notify();
  const RobotModel failed = failed_model(naming, error);
  const bool is_news = std::exchange(entry.reported_failure, failed.reason) != failed.reason;  // not each retry
  station_.set_model(id, failed);
  if (naming.model) {
    const std::string what = not_sent_words(naming, error);
    spdlog::warn("robot '{}': {}", id, what);
    station_.note_model(id, "model_not_confirmed", what);
  } else if (is_news) {
    spdlog::warn("robot '{}': the model: {}", id, failed.reason);
    station_.note_model(id, "model_not_taken_back", failed.reason);
  }
}

// A sink never calls the station: run() does.
void ModelSender::on_robot(const RobotState& robot) {
  const auto found = entries_.find(robot.id);
  if (found == entries_.end()) return;
  if (robot.link == LinkState::disconnected) found->second.seen.on_disconnected();
  if (found->second.seen.boot_id() != robot.boot_id) look_again(robot.id);
}

void ModelSender::on_samples(const RobotState& robot, const SampleBatch& batch) {
  if (batch.next_seq() != robot.next_seq) return;  // sent again: it is not what holds now
  ObservedConfirmation& seen = entries_[robot.id].seen;
  if (seen.on_flag(robot.boot_id, is_confirmed(batch.context.flags), clock_.steady_us())) look_again(robot.id);
}

void ModelSender::on_in_force(const RobotState& robot, const InForceRecord& record) {
  const auto found = entries_.find(robot.id);
  if (!std::holds_alternative<ReportedParameters>(record.content) || found == entries_.end()) return;
  found->second.seen.on_page(record.first_seq, clock_.steady_us());
  look_again(robot.id);
}

// The robot holds the model that was sent last, as confirmed or as assumed.
bool ModelSender::has_arrived(const RobotModel& now, const Entry& entry) {
  if (entry.is_at_work || !entry.naming.model || now.set_at_us != entry.naming.model->set_at_us) return false;
  return now.state == ModelState::confirmed || now.state == ModelState::assumed;
}

// SAFETY: a model that is on its way in nobody's name any more is taken back; what is owed, the station owes from now.
void ModelSender::on_right_ended(const runtime::EndedRight& right) {
  for (auto& [id, entry] : entries_) {
    if (!right.is_of(entry.naming.by.actor)) continue;
    if (!has_arrived(station_.find(id)->model, entry)) {
      entry.naming.own_beside_us.reset();  // nobody else's naming sends what this actor could not
    }
    entry.naming.by = kOfTheStation;
    if (!entry.is_at_work) continue;
    ++entry.naming.number;  // the exchange ends, and its task goes on with this
    entry.owes = entry.owes || entry.naming.model.has_value();
    entry.naming.model.reset();
    open_.insert(id);
  }
}

void ModelSender::look_again(const RobotId& id) {
  changed_.insert(id);
  wake_.notify();
}

asio::awaitable<void> ModelSender::run() {
  for (;;) {
    if (changed_.empty() && open_.empty()) {
      co_await wake_.wait();
    } else if (changed_.empty()) {
      co_await wake_.wait_until(clock_, clock_.steady_us() + kDebtInterval.count());
    }
    std::set<RobotId> robots = std::exchange(changed_, {});
    robots.insert(open_.begin(), open_.end());
    for (const RobotId& id : robots) {
      auto looking = look_at(id);
      co_await alone(id, std::move(looking));
    }
  }
}

asio::awaitable<void> ModelSender::look_at(RobotId id) {
  const RobotState* robot = station_.find(id);
  if (robot != nullptr) follow(*robot, entries_[id]);
  co_return;
}

// Compares what the robot reports now with what is known of it.
void ModelSender::follow(const RobotState& robot, Entry& entry) {
  open_.erase(robot.id);
  if (entry.naming.boot_id != robot.boot_id && entry.naming.boot_id != 0) {
    entry.naming.boot_id = 0;
    entry.naming.own_beside_us.reset();
    entry.owes = false;  // a boot takes every confirmation back
    station_.set_model(robot.id,
                       assumed_model(robot.fluid.empty() ? "" : "the robot has booted: name its fluid again"));
  }
  if (entry.is_at_work || entry.seen.boot_id() != robot.boot_id || !entry.seen.flag()) {
    if (entry.owes) open_.insert(robot.id);
  } else if (entry.owes) {
    settle_debt(robot, entry);
  } else {
    follow_confirmation(robot, entry);
  }
}

void ModelSender::follow_confirmation(const RobotState& robot, Entry& entry) {
  // SAFETY: a model in doubt is confirmed for no robot, also not one that holds its very bits.
  const FluidModel* own = own_model(robot, entry);
  const FluidModel* stored = own != nullptr ? own : models_.find(robot.fluid);
  const FluidModel* model = stored != nullptr && stored->is_confirmed() ? stored : nullptr;
  const auto [finding, is_open] =
      judge(robot, entry.seen, station_.settings(robot.id)->parameters, entry.naming.model, model, clock_.steady_us());
  if (is_open) open_.insert(robot.id);
  if (finding == Finding::taken_back) {
    station_.set_model(robot.id, assumed_model("the robot has taken it back: a parameter was changed"));
  } else if (finding == Finding::model_of_fluid) {
    entry.naming.boot_id = robot.boot_id;
    entry.naming.fluid = robot.fluid;
    if (own == nullptr) entry.naming.own_beside_us.reset();
    entry.naming.model = FluidModel{*model};  // SAFETY: other bits under the flag are noticed by it
    station_.set_model(robot.id, confirmed_model(entry.naming));
  } else if (finding == Finding::by_command) {
    entry.naming.boot_id = robot.boot_id;
    station_.set_model(robot.id, model_confirmed_by_command());
  } else if (finding == Finding::of_unknown_origin) {
    entry.naming = {entry.naming.number + 1, kOfTheStation, robot.boot_id, robot.fluid, std::nullopt};
    entry.owes = true;
    entry.next_try_us = 0;
    station_.set_model(robot.id, model_to_be_taken_back());
  }
}

// SAFETY: nobody's hands are taken from the robot for it: it waits for rest, and until nobody else is in control.
void ModelSender::settle_debt(const RobotState& robot, Entry& entry) {
  if (!*entry.seen.flag()) {
    entry.owes = false;
    if (robot.model.state == ModelState::failed && robot.model.fluid.empty()) {
      station_.set_model(robot.id, unsent_model(models_, robot.fluid));
    }
    return;
  }
  open_.insert(robot.id);
  const std::string& holder = robot.control.holder;
  const bool is_free = holder.empty() || holder == entry.naming.by.actor;
  const bool is_ready = robot.link == LinkState::connected && is_at_rest(robot) && is_free;
  if (!is_ready || clock_.steady_us() < entry.next_try_us) return;
  FluidNaming& naming = entry.naming;
  naming = {naming.number + 1, naming.by, robot.boot_id, robot.fluid, std::nullopt};
  begin(robot.id, entry);
}

}  // namespace server::station
