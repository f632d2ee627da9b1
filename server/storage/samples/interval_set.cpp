// Intervals are merged when they overlap or touch, so a boot without holes is one entry.
#include "server/storage/samples/interval_set.hpp"

#include <algorithm>
#include <iterator>

namespace server::storage {

std::vector<Interval> IntervalSet::covered(Interval range) const {
  std::vector<Interval> parts;
  auto entry = next_by_first_.upper_bound(range.first);
  if (entry != next_by_first_.begin()) --entry;  // the one before may reach into the range
  for (; entry != next_by_first_.end() && entry->first < range.next; ++entry) {
    const Interval part{std::max(entry->first, range.first), std::min(entry->second, range.next)};
    if (part.first < part.next) parts.push_back(part);
  }
  return parts;
}

std::vector<Interval> IntervalSet::missing(Interval range) const {
  std::vector<Interval> parts;
  std::uint64_t at = range.first;
  for (const Interval& here : covered(range)) {
    if (at < here.first) parts.push_back({at, here.first});
    at = here.next;
  }
  if (at < range.next) parts.push_back({at, range.next});
  return parts;
}

std::vector<Interval> IntervalSet::insert(Interval added) {
  std::vector<Interval> parts = missing(added);
  if (parts.empty()) return parts;
  auto entry = next_by_first_.upper_bound(added.first);
  if (entry != next_by_first_.begin() && std::prev(entry)->second >= added.first) --entry;
  while (entry != next_by_first_.end() && entry->first <= added.next) {  // overlaps or touches: swallowed
    added = {std::min(added.first, entry->first), std::max(added.next, entry->second)};
    entry = next_by_first_.erase(entry);
  }
  next_by_first_.emplace_hint(entry, added.first, added.next);
  return parts;
}

bool IntervalSet::extend(Interval added) {
  if (next_by_first_.empty() || next_by_first_.rbegin()->second != added.first) return false;
  next_by_first_.rbegin()->second = added.next;
  return true;
}

void IntervalSet::erase_below(std::uint64_t value) {
  while (!next_by_first_.empty() && next_by_first_.begin()->first < value) {
    const std::uint64_t next = next_by_first_.begin()->second;
    next_by_first_.erase(next_by_first_.begin());
    if (next > value) next_by_first_.emplace(value, next);
  }
}

bool IntervalSet::contains(std::uint64_t value) const {
  const auto after = next_by_first_.upper_bound(value);
  return after != next_by_first_.begin() && value < std::prev(after)->second;
}

std::uint64_t IntervalSet::first_hole() const {
  if (next_by_first_.empty() || next_by_first_.begin()->first != 0) return 0;
  return next_by_first_.begin()->second;
}

std::uint64_t count(const std::vector<Interval>& intervals) {
  std::uint64_t sum = 0;
  for (const Interval& interval : intervals) sum += interval.next - interval.first;
  return sum;
}

}  // namespace server::storage
