// Targets of requests, taken apart once.
#include <gtest/gtest.h>

#include "server/http/target.hpp"

namespace server {
namespace {

TEST(Target, HasADecodedPathAndAnEncodedQuery) {
  const Target target{"/api/v1/robots/r%31/samples?after=1%2D2&limit=3"};
  EXPECT_EQ(target.path(), "/api/v1/robots/r1/samples");
  EXPECT_EQ(target.segments().back(), "samples");
  EXPECT_EQ(target.query(), "after=1%2D2&limit=3");
  EXPECT_EQ(target.text(), "/api/v1/robots/r%31/samples?after=1%2D2&limit=3");
}

TEST(Target, IsNotAcceptableWhereItsPathCouldMeanAnotherOne) {
  for (const char* text :
       {"", "api", "?a=1", "/a/../b", "/a/%2e%2e/b", "/a/./b", "/a%2Fb", "/a%5Cb", "/a%00", "/a%", "/a%2"}) {
    const Target target{text};
    EXPECT_FALSE(target.is_acceptable()) << text;
    EXPECT_EQ(target.path(), "") << text;
    EXPECT_TRUE(target.segments().empty()) << text;
  }
}

TEST(Target, OfTheRootHasOneEmptySegment) {
  const Target target{"/"};
  EXPECT_TRUE(target.is_acceptable());
  EXPECT_EQ(target.path(), "/");
  EXPECT_EQ(target.segments().size(), 1u);
}

}  // namespace
}  // namespace server
