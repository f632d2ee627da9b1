// What rheonaut-sim says of a pin or an authority that cannot be used. That the wrong station is refused, and the right
// one is not, shows tests/system/tls_test.py with a real one.
#include "sim_robot/client/station_trust.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace sim_robot {
namespace {

using ::testing::HasSubstr;

std::string mistake(const std::optional<std::string>& pin, const std::optional<std::string>& authority) {
  try {
    StationTrust{pin, authority, "127.0.0.1"};
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no mistake was found";
}

TEST(StationTrust, NamesTheOptionAndTheValueThatIsWrong) {
  EXPECT_THAT(mistake("abc", {}), HasSubstr("--tls-pin: 'abc'"));
  EXPECT_THAT(mistake(std::string(63, 'a') + "g", {}), HasSubstr("64 hexadecimal digits"));
  EXPECT_THAT(mistake({}, "/none/such.crt"), HasSubstr("--tls-ca: '/none/such.crt'"));
  EXPECT_THAT(mistake({}, {}), HasSubstr("--tls-pin or --tls-ca"));
  EXPECT_THAT(mistake({}, "/etc/hostname"), HasSubstr("'/etc/hostname' holds no certificates in PEM"));
}

// OpenSSL's own reader does not end.
TEST(StationTrust, ReadsNoAuthorityWithoutEnd) {
  EXPECT_EQ(mistake({}, "/dev/zero"), "--tls-ca: '/dev/zero' has more than 4194304 bytes");
}

TEST(StationTrust, TakesAPinInEitherCaseAndWithColons) {
  std::string colons = "AB";
  for (int i = 1; i < 32; ++i) colons += ":cd";
  EXPECT_EQ(mistake(colons, {}), "no mistake was found");
}

}  // namespace
}  // namespace sim_robot
