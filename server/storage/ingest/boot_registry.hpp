// Knows the boots that are in use, and for each what is to be done with it: what is due, ageing, has records, has
// holes.
//
//   enter() → admit() → start() → watch() after every change → … → forget_unused()
//
// Work is found in lists, so that nobody looks at all boots each 100 ms. They are served in the order in which their
// work came up, those that age by the time since which their oldest sample waits.
//
// Loop thread only; owned by the Recorder. Plain bookkeeping: it neither waits nor writes. Times are the caller's:
// `now_us` is steady, `utc_us` is UTC.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "server/storage/ingest/boot_entry.hpp"

namespace server::storage {

// The refusal of a boot whose robot has connected with another one: what is known of it may be out of date.
station::Admission another_boot_connected();

class BootRegistry {
 public:
  using Boots = std::unordered_map<station::BootId, BootEntry>;  // an entry stays where it is

  // What a boot's connection has brought about.
  struct Started {
    BootStart start;                   // to be stored after the samples of the replaced boots
    std::vector<BootEntry*> replaced;  // the robot's other boots, whose samples are to be enqueued; watch() each
  };

  BootRegistry() = default;
  // `next_boot_key` is for the next new boot; `restored_at_us` is UTC, 0 when the database is not made of a backup.
  BootRegistry(std::int64_t next_boot_key, std::int64_t restored_at_us)
      : next_boot_key_{next_boot_key}, restored_at_us_{restored_at_us} {}

  bool empty() const { return boots_.empty(); }
  Boots& all() { return boots_; }
  BootEntry* find(station::BootId boot_id);  // null: it is not in use
  const BootEntry* find(station::BootId boot_id) const;
  const BootEntry* find_loaded(station::BootId boot_id) const;  // null: nothing can be known of it yet
  BootEntry* find_recorded(station::BootId boot_id);            // null unless samples of it are recorded now

  // The boot's entry, made if there is none. A caller that waits for the answer of an admission counts itself in
  // `admissions`.
  BootEntry& enter(station::BootId boot_id, const station::RobotId& robot_id);

  // Another boot of this robot has connected, and that was not stored at `since_us`: what was read of any other boot
  // since, may be what it was before it ended.
  bool another_starts(const station::AdmissionRequest& request, std::int64_t since_us) const;

  // The boot of this request goes on as `stored`, what the database has of it, or as what is known of it here; a boot
  // without a key gets the next one. Refused when it is another robot's, was replaced, or cannot have gone back to what
  // the request says. `answer` is the admission by the database, which is completed.
  station::Admission admit(BootEntry& boot, StoredBoot stored, station::Admission answer,
                           const station::AdmissionRequest& request, std::int64_t now_us);

  // What is stored of it is known here from now on; the boot has not connected since.
  void load(BootEntry& boot, StoredBoot stored, const station::RobotId& robot_id);

  // A refused boot leaves nothing behind: the next forget_unused() looks for it.
  void forget_soon() { forget_at_once_ = true; }

  // The admitted boot has connected: it takes the place of the robot's other boots that have ever connected, as
  // BootStore::start() ends them in the database.
  Started start(BootEntry& boot, std::int64_t utc_us);

  // After every change of a boot: it stands in the lists of what is to be done with it.
  void watch(BootEntry& boot);

  // The next boot with a complete segment, or with waiting samples and no connection; null: none.
  BootEntry* take_due() { return due_.take_first(); }
  // The next boot whose oldest waiting sample is old; null: none. watch() it after its samples were enqueued.
  BootEntry* take_aged(std::int64_t now_us);
  // Boots with gaps or events; taking their records removes them from the list.
  BootsWithRecords& with_records() { return with_records_; }
  // How many may have holes, and the next of them, which goes to the end of the list; null: it has none any more.
  std::size_t holes() const { return with_holes_.size(); }
  BootEntry* next_with_holes();

  // Boots that nobody has used for a minute, were replaced or refused.
  void forget_unused(std::int64_t now_us);

 private:
  void load_or_number(BootEntry& boot, StoredBoot stored, const station::AdmissionRequest& request);
  std::vector<BootEntry*> replace_others(const BootEntry& boot, std::int64_t utc_us);
  void replace(BootEntry& boot, std::int64_t utc_us);
  void forget(const BootEntry& boot);

  Boots boots_;
  std::unordered_multimap<station::RobotId, BootEntry*> by_robot_;  // those that are loaded
  std::int64_t next_boot_key_ = 0;
  std::int64_t restored_at_us_ = 0;

  BootsDue due_;
  BootsAgeing ageing_;
  BootsWithRecords with_records_;
  BootsWithHoles with_holes_;

  std::int64_t next_forget_us_ = 0;  // steady
  std::size_t replaced_ = 0;         // boots that are still here
  bool forget_at_once_ = false;
};

}  // namespace server::storage
