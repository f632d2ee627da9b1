// The table of parameters put together from pages, whatever the pages say.
#include "server/station/state/in_force.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <initializer_list>

namespace server {
namespace {

protocol::ParameterPage page_of(std::uint32_t total, std::initializer_list<std::pair<const char*, float>> values) {
  protocol::ParameterPage page = rheonaut_ParameterPage_init_zero;
  page.total = total;
  for (const auto& [name, value] : values) {
    rheonaut_Parameter& parameter = page.parameters[page.parameters_count++];
    std::strncpy(parameter.name, name, sizeof parameter.name - 1);
    std::strncpy(parameter.unit, "s", sizeof parameter.unit - 1);
    parameter.value = value;
    parameter.minimum = -1;
    parameter.maximum = 10;
    parameter.default_value = 2;
  }
  return page;
}

TEST(ParameterTableTest, IsReportedWhenEveryParameterIsKnownAndAgainWhenOneHasChanged) {
  station::ParameterTable table;
  EXPECT_FALSE(table.add(page_of(3, {{"a", 0.1F}, {"b", 2}})));
  EXPECT_FALSE(table.is_current());
  EXPECT_TRUE(table.add(page_of(3, {{"c", 3}})));
  EXPECT_TRUE(table.is_current());
  ASSERT_EQ(table.last_known().size(), 3U);
  EXPECT_EQ(table.last_known().at("a").value, 0.1F);

  EXPECT_FALSE(table.add(page_of(3, {{"b", 2}}))) << "nothing has changed";
  EXPECT_TRUE(table.add(page_of(3, {{"b", 5}})));
  EXPECT_EQ(table.last_known().at("b").value, 5);
}

TEST(ParameterTableTest, AChangeOfWhatIsBesideTheValueIsAChange) {
  using Change = void (*)(rheonaut_Parameter&);
  const std::initializer_list<Change> changes{
      [](rheonaut_Parameter& one) { one.unit[0] = 'm'; }, [](rheonaut_Parameter& one) { one.minimum = -2; },
      [](rheonaut_Parameter& one) { one.maximum = 11; }, [](rheonaut_Parameter& one) { one.default_value = 3; }};
  station::ParameterTable table;
  auto page = page_of(1, {{"a", 1}});
  ASSERT_TRUE(table.add(page));
  for (const Change change : changes) {
    change(page.parameters[0]);
    EXPECT_TRUE(table.add(page));
    EXPECT_FALSE(table.add(page));
  }
}

TEST(ParameterTableTest, ANewConnectionReportsTheSameTableAgain) {
  station::ParameterTable table;
  ASSERT_TRUE(table.add(page_of(1, {{"a", 1}})));
  table.begin_again();
  EXPECT_FALSE(table.is_current());
  EXPECT_EQ(table.last_known().size(), 1U) << "it stays known";
  EXPECT_FALSE(table.value("a").has_value());
  EXPECT_TRUE(table.add(page_of(1, {{"a", 1}})));
}

TEST(ParameterTableTest, ANumberThatIsNoneDoesNotChangeForEver) {
  station::ParameterTable table;
  EXPECT_TRUE(table.add(page_of(1, {{"a", std::nanf("")}})));
  EXPECT_FALSE(table.add(page_of(1, {{"a", std::nanf("")}})));
}

TEST(ParameterTableTest, ARobotThatNamesEverMoreParametersFillsNoMemory) {
  station::ParameterTable table;
  for (int i = 0; i < 10'000; ++i) {
    EXPECT_FALSE(table.add(page_of(1, {{("p" + std::to_string(i)).c_str(), 1}, {"q", 1}})));
  }
  EXPECT_FALSE(table.add(page_of(4'000'000'000, {{"a", 1}})));
}

}  // namespace
}  // namespace server
