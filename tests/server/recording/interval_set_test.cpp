// The set of intervals behaves as a set of numbers.
#include "server/storage/samples/interval_set.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace server {
namespace {

using Intervals = std::vector<storage::Interval>;

TEST(IntervalSet, InsertReturnsOnlyWhatWasNew) {
  storage::IntervalSet set;
  EXPECT_EQ(set.insert({10, 20}), (Intervals{{10, 20}}));
  EXPECT_EQ(set.insert({5, 25}), (Intervals{{5, 10}, {20, 25}}));
  EXPECT_EQ(set.insert({5, 25}), Intervals{});
  EXPECT_EQ(set.insert({7, 7}), Intervals{});
}

TEST(IntervalSet, TheFirstHoleIsWhereTheCumulativePartEnds) {
  storage::IntervalSet set;
  EXPECT_EQ(set.first_hole(), 0u);
  set.insert({5, 10});
  EXPECT_EQ(set.first_hole(), 0u);
  set.insert({0, 5});
  EXPECT_EQ(set.first_hole(), 10u);
  EXPECT_EQ(set.end(), 10u);
}

TEST(IntervalSet, KnowsWhatIsCoveredAndWhatIsMissing) {
  storage::IntervalSet set;
  set.insert({2, 4});
  set.insert({6, 8});
  EXPECT_EQ(set.missing({0, 10}), (Intervals{{0, 2}, {4, 6}, {8, 10}}));
  EXPECT_EQ(set.covered({3, 7}), (Intervals{{3, 4}, {6, 7}}));
}

TEST(IntervalSet, ExtendAddsOnlyAtTheEnd) {
  storage::IntervalSet set;
  EXPECT_FALSE(set.extend({0, 5}));
  set.insert({0, 5});
  EXPECT_FALSE(set.extend({4, 8}));
  EXPECT_FALSE(set.extend({6, 8}));
  EXPECT_TRUE(set.extend({5, 9}));
  EXPECT_EQ(set.covered({0, 20}), (Intervals{{0, 9}}));
}

TEST(IntervalSet, EraseBelowKeepsTheRestAsItWas) {
  storage::IntervalSet set;
  set.insert({2, 4});
  set.insert({6, 10});
  set.erase_below(2);
  EXPECT_EQ(set.covered({0, 20}), (Intervals{{2, 4}, {6, 10}}));
  set.erase_below(7);
  EXPECT_EQ(set.covered({0, 20}), (Intervals{{7, 10}}));
  set.erase_below(10);
  EXPECT_EQ(set, storage::IntervalSet{});
}

std::set<std::uint64_t> numbers(const Intervals& intervals) {
  std::set<std::uint64_t> found;
  for (const storage::Interval& interval : intervals) {
    for (std::uint64_t n = interval.first; n < interval.next; ++n) EXPECT_TRUE(found.insert(n).second);
  }
  return found;
}

TEST(IntervalSet, AgreesWithANaiveSetUnderRandomInsertions) {
  constexpr std::uint64_t kLimit = 80;
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random{seed};
    storage::IntervalSet set;
    std::set<std::uint64_t> model;
    for (int step = 0; step < 30; ++step) {
      const std::uint64_t first = random() % kLimit;
      const storage::Interval added{first, first + random() % 12};
      std::set<std::uint64_t> expected;
      for (std::uint64_t n = added.first; n < added.next; ++n) {
        if (model.insert(n).second) expected.insert(n);
      }
      ASSERT_EQ(numbers(set.insert(added)), expected);
      std::uint64_t hole = 0;
      while (model.contains(hole)) ++hole;
      ASSERT_EQ(set.first_hole(), hole);
      ASSERT_EQ(set.end(), model.empty() ? 0 : *model.rbegin() + 1);
      const storage::Interval range{random() % kLimit, kLimit + 20};
      std::set<std::uint64_t> covered;
      std::set<std::uint64_t> missing;
      for (std::uint64_t n = range.first; n < range.next; ++n) (model.contains(n) ? covered : missing).insert(n);
      ASSERT_EQ(numbers(set.covered(range)), covered);
      ASSERT_EQ(numbers(set.missing(range)), missing);
      for (std::uint64_t n = 0; n < kLimit + 20; ++n) ASSERT_EQ(set.contains(n), model.contains(n));
    }
  }
}

}  // namespace
}  // namespace server
