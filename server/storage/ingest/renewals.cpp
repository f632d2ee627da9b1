#include "server/storage/ingest/renewals.hpp"

#include <algorithm>

namespace server::storage {
namespace {

bool belongs_to(const station::CommandRecord& first, const station::CommandRecord& renewal) {
  return renewal.actor == first.actor && renewal.peer == first.peer && renewal.boot_id == first.boot_id &&
         renewal.arguments == first.arguments;
}

bool has_begun(const station::CommandRecord& command) {
  return command.state == station::CommandState::queued || command.kind == "emergency_stop";
}

}  // namespace

station::CommandRecord Renewals::Row::record() const {
  station::CommandRecord counted = first;
  counted.further_renewals = further;
  counted.last_renewed_at_us = last_renewed_at_us;
  return counted;
}

Renewals::Records Renewals::take(const station::CommandRecord& command, std::int64_t now_us) {
  const auto known = by_robot_.find(command.robot_id);
  const bool is_renewal = command.kind == "renew_lease";
  if (!is_renewal && known == by_robot_.end()) return {command};
  Records due;
  Rows& rows = known == by_robot_.end() ? by_robot_[command.robot_id] : known->second;
  if (is_renewal) {
    take_renewal(rows, command, now_us, due);
  } else {
    for (Row& row : rows) row.is_over = row.is_over || has_begun(command);
    take_over(rows, due);
    due.push_back(command);
  }
  if (rows.empty()) by_robot_.erase(command.robot_id);
  return due;
}

void Renewals::take_renewal(Rows& rows, const station::CommandRecord& renewal, std::int64_t now_us, Records& due) {
  const auto is_in = [&renewal](const Row& row) {
    return row.first.id == renewal.id || row.on_their_way.contains(renewal.id);
  };
  if (const auto row = std::ranges::find_if(rows, is_in); row != rows.end()) {
    if (row->first.id == renewal.id) return take_first(rows, row, renewal, now_us, due);
    take_next(*row, renewal, now_us, due);
    return take_over(rows, due);
  }
  // One that ended without being on its way, or that is answered after its end, has a record of its own.
  if (renewal.state != station::CommandState::queued) return due.push_back(renewal);
  const auto goes_on = std::ranges::find(rows, false, &Row::is_over);
  if (goes_on != rows.end() && belongs_to(goes_on->first, renewal)) {
    goes_on->on_their_way.emplace(renewal.id, renewal);
    return;
  }
  for (Row& row : rows) row.is_over = true;
  take_over(rows, due);
  rows.push_back({.first = renewal, .on_their_way = {}});
  due.push_back(renewal);
}

void Renewals::take_first(Rows& rows, Rows::iterator row, const station::CommandRecord& renewal, std::int64_t now_us,
                          Records& due) {
  if (row->is_accepted) return;
  row->first = renewal;
  due.push_back(renewal);
  if (renewal.ended_at_us == 0) return;
  if (was_accepted(renewal.state)) {
    row->is_accepted = true;
    row->answered_us = now_us;
    due.back().further_renewals.reset();
    return take_over(rows, due);
  }
  rows.erase(row);  // those on their way end by themselves
}

void Renewals::take_next(Row& row, const station::CommandRecord& renewal, std::int64_t now_us, Records& due) {
  if (renewal.ended_at_us == 0) {
    row.on_their_way[renewal.id] = renewal;
    return;
  }
  row.on_their_way.erase(renewal.id);
  if (!was_accepted(renewal.state)) return due.push_back(renewal);
  ++row.further;
  row.answered_us = now_us;
  row.last_renewed_at_us = std::max(row.last_renewed_at_us, renewal.submitted_at_us);
}

// Those that are over and wait for nothing.
void Renewals::take_over(Rows& rows, Records& due) {
  std::erase_if(rows, [&due](const Row& row) {
    const bool has_ended = row.is_over && !row.is_waiting();
    if (has_ended) due.push_back(row.record());
    return has_ended;
  });
}

Renewals::Records Renewals::take_ended(std::int64_t now_us) {
  Records due;
  for (auto& [robot_id, rows] : by_robot_) {
    for (Row& row : rows) {
      row.is_over = row.is_over || (!row.is_waiting() && now_us - row.answered_us > kSilence.count());
    }
    take_over(rows, due);
  }
  std::erase_if(by_robot_, [](const auto& of_robot) { return of_robot.second.empty(); });
  return due;
}

Renewals::Records Renewals::take_all() {
  Records due;
  for (auto& [robot_id, rows] : by_robot_) {
    for (const Row& row : rows) {
      if (row.is_accepted) due.push_back(row.record());
      for (const auto& [id, renewal] : row.on_their_way) due.push_back(renewal);
    }
  }
  by_robot_.clear();
  return due;
}

}  // namespace server::storage
