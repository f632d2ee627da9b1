// A key takes values of its type and of no other, and a range has both its ends.
#include "base/toml_value.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>

#include "base/fields.hpp"

namespace base {
namespace {

template <class T>
std::optional<T> read(const char* value) {
  const toml::table table = toml::parse(std::string{"key = "} + value);
  return exact<T>(*table.get("key"));
}

TEST(TomlValue, IsOfItsTypeOnly) {
  EXPECT_EQ(read<std::int64_t>("3"), 3);
  EXPECT_EQ(read<std::int64_t>("3.0"), std::nullopt);
  EXPECT_EQ(read<std::int64_t>("true"), std::nullopt);
  EXPECT_EQ(read<bool>("true"), true);
  EXPECT_EQ(read<bool>("1"), std::nullopt);
  EXPECT_EQ(read<std::string>("'3'"), "3");
  EXPECT_EQ(read<std::string>("3"), std::nullopt);
}

TEST(TomlValue, IsANumberWithOrWithoutAPoint) {
  EXPECT_EQ(read<double>("1.5"), 1.5);
  EXPECT_EQ(read<double>("2"), 2.0);
  EXPECT_EQ(read<double>("'2'"), std::nullopt);
  EXPECT_EQ(read<double>("true"), std::nullopt);
}

TEST(Range, HoldsItsEndsAndNoNan) {
  const Range range{-1, 2};
  EXPECT_TRUE(range.holds(-1));
  EXPECT_TRUE(range.holds(2));
  EXPECT_FALSE(range.holds(-1.001));
  EXPECT_FALSE(range.holds(2.001));
  EXPECT_FALSE(range.holds(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_TRUE(Range{}.holds(std::numeric_limits<double>::infinity()));
}

}  // namespace
}  // namespace base
