// A set of sequence numbers, kept as disjoint intervals: for example the stored samples of a boot.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

namespace server::storage {

struct Interval {  // [first, next), empty when next <= first
  std::uint64_t first = 0;
  std::uint64_t next = 0;
  bool operator==(const Interval&) const = default;
};

class IntervalSet {
 public:
  // Adds an interval and returns the parts that were not in the set, ascending.
  std::vector<Interval> insert(Interval added);

  // Removes everything below a number.
  void erase_below(std::uint64_t value);

  // Adds an interval that begins at end(), without allocating; false, and nothing is added, if it does not.
  bool extend(Interval added);

  // The parts of an interval that are in the set, and those that are not; ascending.
  std::vector<Interval> covered(Interval range) const;
  std::vector<Interval> missing(Interval range) const;

  bool contains(std::uint64_t value) const;

  // The smallest number that is not in the set: everything below it is.
  std::uint64_t first_hole() const;

  // One above the largest number in the set; 0 when empty.
  std::uint64_t end() const { return next_by_first_.empty() ? 0 : next_by_first_.rbegin()->second; }

  bool operator==(const IntervalSet&) const = default;

 private:
  std::map<std::uint64_t, std::uint64_t> next_by_first_;  // neither overlapping nor touching
};

std::uint64_t count(const std::vector<Interval>& intervals);

}  // namespace server::storage
