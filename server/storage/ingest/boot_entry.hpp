// A boot that is in use: what is recorded of it, whether its robot is connected, and in which lists of work it stands.
//
// Plain values of the loop thread. The BootRegistry owns the entries and the lists of what is to be done with them; the
// CommitQueue owns the list of those that a commit is about. An entry stays where it is until it is forgotten, and that
// is not before it has left every list.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "server/storage/ingest/boot_recording.hpp"
#include "server/storage/ingest/work_list.hpp"

namespace server::storage {

struct BootEntry {
  BootEntry(station::BootId id, station::RobotId robot_id) : boot_id{id}, recording{std::move(robot_id)} {}

  // Samples and events of it are recorded now.
  bool is_recorded() const { return started && !replaced; }
  // The robot that this boot belongs to, as far as that is known.
  std::optional<station::RobotId> owner() const {
    return recording.loaded() ? std::optional{recording.robot_id()} : std::nullopt;
  }
  // Nothing of its samples and gaps waits for the disk.
  bool is_stored() const {
    return !in_commit.is_listed() && queued_segments == 0 && !with_records.is_listed() && recording.waiting().empty();
  }
  bool is_listed() const {
    return due.is_listed() || ageing.is_listed() || with_records.is_listed() || with_holes.is_listed() ||
           in_commit.is_listed() || queued_segments > 0 || queued_starts > 0;
  }

  const station::BootId boot_id;
  BootRecording recording;
  bool connected = false;
  bool started = false;                            // has been connected
  bool replaced = false;                           // a later boot of this robot has connected
  int admissions = 0;                              // under way
  std::int64_t last_used_us = 0;                   // steady time of the last admission
  std::optional<station::AdmissionRequest> hello;  // admitted, and not connected since

  WorkLink<BootEntry> due;           // has a complete segment, or waiting samples and no connection
  TimedLink ageing;                  // has waiting samples
  WorkLink<BootEntry> with_records;  // has gaps or events that no commit has yet
  WorkLink<BootEntry> with_holes;    // misses something that its robot may still hold
  WorkLink<BootEntry> in_commit;     // a commit is about it, whose outcome was not reported yet
  std::size_t queued_segments = 0;   // in the CommitQueue
  std::size_t queued_starts = 0;     // in the CommitQueue or its commit
};

using BootsDue = WorkList<BootEntry, &BootEntry::due>;
using BootsAgeing = TimedWorkList<BootEntry, &BootEntry::ageing>;
using BootsWithRecords = WorkList<BootEntry, &BootEntry::with_records>;
using BootsWithHoles = WorkList<BootEntry, &BootEntry::with_holes>;
using BootsInCommit = WorkList<BootEntry, &BootEntry::in_commit>;

}  // namespace server::storage
