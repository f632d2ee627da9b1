// What the recorder gives up as lost, and a boot that returns with it.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <deque>
#include <nlohmann/json.hpp>

#include "server/runtime/exceptions.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/ingest/boot_segments.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

Error not_durable(const char* what) {
  return {ErrorCode::unavailable, fmt::format("{}; the station's log says why the disk cannot be written", what), ""};
}

std::string with_what_is_given_up(const std::string& detail, std::uint64_t samples, nlohmann::json boots) {
  nlohmann::json object = nlohmann::json::parse(detail, nullptr, false);
  object["samples"] = samples;
  object["boots"] = std::move(boots);
  return station::audit_detail(object);
}

}  // namespace

asio::awaitable<Result<std::uint64_t>> Recorder::give_up(GiveUpOrder order) {
  std::vector<BootEntry*> boots;
  std::deque<runtime::Counted<int>> held;  // each stays in the registry, as while it is being admitted
  for (const GiveUpOrder::Part& part : order.parts) {
    boots.push_back(&boots_->enter(part.boot_id, order.robot_id));
    held.emplace_back(boots.back()->admissions);
    wake();
    const bool is_read = co_await load(*boots.back(), order.robot_id);
    if (!is_read) co_return std::unexpected{not_durable("nothing was given up")};
  }
  if (failing()) co_return std::unexpected{not_durable("nothing was given up")};

  // From here to the wait nothing else runs: what is counted is what is given up, and one commit gets all of it.
  std::uint64_t samples = 0;
  nlohmann::json by_boot = nlohmann::json::array();
  for (std::size_t index = 0; index < boots.size(); ++index) {
    const BootEntry& boot = *boots[index];
    if (boot.recording.robot_id() != order.robot_id) continue;
    if (boot.connected) {
      co_return fail(ErrorCode::conflict,
                     fmt::format("robot '{}' is connected: it is asked for these samples and sends what it still holds",
                                 order.robot_id),
                     "robot_connected");
    }
    const std::vector<Interval> missing = boot.recording.missing(order.parts[index].samples);
    if (missing.empty()) continue;
    samples += count(missing);
    by_boot.push_back({{"boot_id", std::to_string(boot.boot_id)},
                       {"first_seq", missing.front().first},
                       {"last_seq", missing.back().next - 1},
                       {"samples", count(missing)}});
  }
  if (order.samples && *order.samples != samples) {
    co_return fail(ErrorCode::conflict,
                   fmt::format("{} samples are missing now, not {}; nothing was given up: look at them again", samples,
                               *order.samples),
                   "missing_changed");
  }
  if (samples == 0) co_return 0;
  for (std::size_t index = 0; index < boots.size(); ++index) {
    if (boots[index]->recording.robot_id() != order.robot_id) continue;
    boots[index]->recording.give_up(order.parts[index].samples, clock_.utc_us());
    boots_->watch(*boots[index]);
  }
  order.note.detail = with_what_is_given_up(order.note.detail, samples, std::move(by_boot));
  queue_->enqueue(order.note);  // whatever waits: no loss without its entry
  const bool is_durable = co_await flush_records();
  if (!is_durable) co_return std::unexpected{not_durable("they are given up as soon as the disk can be written")};
  spdlog::warn("{} samples of robot '{}' are given up: {}", samples, order.robot_id, order.note.detail);
  co_return samples;
}

// So that what a commit stores of it and what is known here are the same. False: the disk fails.
asio::awaitable<bool> Recorder::load(BootEntry& boot, station::RobotId robot_id) {
  if (boot.recording.loaded()) co_return true;
  auto job = [robot_id, boot_id = boot.boot_id](Database& database) -> std::optional<StoredBoot> {
    try {
      return BootStore{database}.find(robot_id, boot_id);
    } catch (const SQLite::Exception& error) {
      spdlog::error("boot {} of robot '{}' cannot be read: {}", boot_id, robot_id, runtime::text_of(error));
      return std::nullopt;
    }
  };
  std::optional<StoredBoot> stored = co_await on_disk(std::move(job));
  if (stored && stored->key != 0 && !boot.recording.loaded()) boots_->load(boot, std::move(*stored), robot_id);
  if (!boot.recording.loaded()) boots_->forget_soon();
  co_return stored.has_value();
}

void Recorder::note_returned(const BootEntry& boot) {
  const std::vector<Interval>& held = boot.recording.returned();
  if (held.empty()) return;
  const std::uint64_t samples = count(held);
  counters_.samples_returned += samples;
  returned_.push_back({boot.recording.robot_id(), boot.boot_id, {held.front().first, held.back().next}, samples});
}

// Not from inside a report of the station's.
void Recorder::report_returned() {
  for (const ReturnedSamples& returned : std::exchange(returned_, {})) {
    spdlog::warn("robot '{}' is back with {} samples between {} and {} that were given up: they are not recorded",
                 returned.robot_id, returned.samples, returned.range.first, returned.range.next - 1);
    if (on_returned_) on_returned_(returned);
  }
}

}  // namespace server::storage
