// Targets of requests, taken apart once.
#include <gtest/gtest.h>

#include "server/http/target.hpp"

namespace server {
namespace {

TEST(Target, HasADecodedPathAndQuery) {
  const http::Target target{"/api/v1/robots/r%31/samples?after=1%2D2&limit=3"};
  EXPECT_EQ(target.path(), "/api/v1/robots/r1/samples");
  EXPECT_EQ(target.segments().back(), "samples");
  EXPECT_EQ(target.query(), (http::Target::Query{{"after", "1-2"}, {"limit", "3"}}));
  EXPECT_EQ(target.text(), "/api/v1/robots/r%31/samples?after=1%2D2&limit=3");
}

TEST(Target, IsNotAcceptableWhereItsPathCouldMeanAnotherOne) {
  for (const char* text :
       {"", "api", "?a=1", "/a/../b", "/a/%2e%2e/b", "/a/./b", "/a%2Fb", "/a%5Cb", "/a%00", "/a%", "/a%2"}) {
    const http::Target target{text};
    EXPECT_FALSE(target.is_acceptable()) << text;
    EXPECT_EQ(target.path(), "") << text;
    EXPECT_TRUE(target.segments().empty()) << text;
  }
}

TEST(Target, OfTheAbsoluteFormHasAnAuthority) {
  const http::Target target{"HTTP://lab-pc:8080/api/v1/robots?x=1"};
  EXPECT_EQ(target.authority(), "lab-pc:8080");
  EXPECT_EQ(target.text(), "/api/v1/robots?x=1");
  EXPECT_EQ(target.path(), "/api/v1/robots");
  EXPECT_EQ(http::Target{"https://lab-pc"}.path(), "/");
  EXPECT_EQ(http::Target{"http://lab-pc?x=1"}.query(), (http::Target::Query{{"x", "1"}}));
  EXPECT_FALSE(http::Target{"http://localhost:x@evil.example/x"}.is_acceptable());
  EXPECT_FALSE(http::Target{"ftp://lab-pc/x"}.is_acceptable());
  EXPECT_EQ(http::Target{"/http://lab-pc/x"}.authority(), "");
}

TEST(Target, QueryKeepsOrderAndRepeatedNames) {
  EXPECT_EQ(http::Target{"/a?x=1&y&x=a+b&=c&&z=1=2"}.query(),
            (http::Target::Query{{"x", "1"}, {"y", ""}, {"x", "a b"}, {"", "c"}, {"", ""}, {"z", "1=2"}}));
  for (const char* text : {"", "/a", "/a?"}) EXPECT_EQ(http::Target{text}.query(), http::Target::Query{}) << text;
}

TEST(Target, QueryIsEmptyWhereItIsNotAValidEncoding) {
  for (const char* text : {"/a?x=%", "/a?x=%2", "/a?%zz", "/a?x=%00", "/a?x=1&y=%0a"}) {
    EXPECT_EQ(http::Target{text}.query(), std::nullopt) << text;
    EXPECT_EQ(http::Target{text}.path(), "/a") << text;
  }
}

TEST(Target, OfTheRootHasOneEmptySegment) {
  const http::Target target{"/"};
  EXPECT_TRUE(target.is_acceptable());
  EXPECT_EQ(target.path(), "/");
  EXPECT_EQ(target.segments().size(), 1u);
}

}  // namespace
}  // namespace server
