// Lists of work: an entry stands in a list once, in the order in which it was added.
#include "server/storage/ingest/work_list.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace server {
namespace {

struct Item {
  storage::WorkLink<Item> red;
  storage::WorkLink<Item> blue;
  storage::TimedLink timed;
};
using RedItems = storage::WorkList<Item, &Item::red>;
using BlueItems = storage::WorkList<Item, &Item::blue>;
using TimedItems = storage::TimedWorkList<Item, &Item::timed>;

std::vector<Item*> listed(const RedItems& list) {
  std::vector<Item*> items;
  for (Item* item = list.first(); item != nullptr; item = list.after(*item)) items.push_back(item);
  return items;
}

TEST(WorkList, KeepsTheOrderAndHasNothingTwice) {
  Item a, b, c;
  RedItems red;
  for (Item* item : {&b, &a, &b, &c}) red.add(*item);
  EXPECT_EQ(listed(red), (std::vector<Item*>{&b, &a, &c}));
  EXPECT_EQ(red.size(), 3u);
  EXPECT_EQ(red.take_first(), &b);
  EXPECT_FALSE(b.red.is_listed());
  red.add(b);
  EXPECT_EQ(listed(red), (std::vector<Item*>{&a, &c, &b}));
}

TEST(WorkList, RemovesAtEveryPlace) {
  Item a, b, c;
  RedItems red;
  for (Item* item : {&a, &b, &c}) red.add(*item);
  red.remove(b);
  EXPECT_EQ(listed(red), (std::vector<Item*>{&a, &c}));
  red.remove(b);
  red.remove(c);
  red.add(b);
  EXPECT_EQ(listed(red), (std::vector<Item*>{&a, &b}));
  red.remove(a);
  red.remove(b);
  EXPECT_TRUE(red.empty());
  EXPECT_EQ(red.take_first(), nullptr);
  EXPECT_EQ(red.size(), 0u);
}

TEST(WorkList, AnEntryMayStandInSeveral) {
  Item a;
  RedItems red;
  BlueItems blue;
  red.add(a);
  blue.add(a);
  red.remove(a);
  EXPECT_FALSE(a.red.is_listed());
  EXPECT_TRUE(a.blue.is_listed());
  EXPECT_EQ(blue.first(), &a);
}

TEST(TimedWorkList, GivesWhatIsDueTheEarliestFirst) {
  Item a, b;
  TimedItems timed;
  timed.add(a, 200);
  timed.add(b, 100);
  timed.add(a, 50);  // stands there already
  EXPECT_EQ(timed.take_due(99), nullptr);
  EXPECT_EQ(timed.take_due(200), &b);
  EXPECT_FALSE(b.timed.is_listed());
  EXPECT_TRUE(a.timed.is_listed());
  EXPECT_EQ(timed.take_due(199), nullptr);
  EXPECT_EQ(timed.take_due(200), &a);
  EXPECT_EQ(timed.take_due(1000), nullptr);
}

}  // namespace
}  // namespace server
