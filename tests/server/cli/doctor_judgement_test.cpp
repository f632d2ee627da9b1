// What the doctor says of machines that no test machine is, and what a redaction leaves.
#include <gmock/gmock.h>

#include "server/cli/health/machine_checks.hpp"
#include "server/cli/health/redaction.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::uint64_t kRoomForAll = 900'000'000'000;

cli::Finding judged(const cli::Findings& findings, const std::string& topic) {
  for (const cli::Finding& finding : findings.all()) {
    if (finding.topic == topic) return finding;
  }
  return {};
}

cli::Finding clock_finding(const cli::ClockFacts& facts) {
  cli::Findings findings;
  judge_clock(facts, findings);
  return judged(findings, "clock");
}

cli::Finding disk_finding(const cli::DiskFacts& facts, const std::string& topic) {
  cli::Findings findings;
  judge_disk(facts, {}, findings);
  return judged(findings, topic);
}

TEST(Doctor, JudgesTheClock) {
  EXPECT_EQ(clock_finding({.is_synchronised = true}).grade, cli::Grade::fine);
  EXPECT_EQ(clock_finding({.is_synchronised = false}).grade, cli::Grade::note);
  EXPECT_THAT(clock_finding({.is_synchronised = false}).what, HasSubstr("not synchronised"));
  EXPECT_EQ(clock_finding({.is_synchronised = std::nullopt}).grade, cli::Grade::note);
  const cli::Finding jumps = clock_finding({.is_synchronised = true, .step_ms = -1500});
  EXPECT_EQ(jumps.grade, cli::Grade::problem);
  EXPECT_THAT(jumps.what, HasSubstr("jumped by -1500 ms"));
  EXPECT_EQ(clock_finding({.is_synchronised = true, .step_ms = 5}).grade, cli::Grade::fine) << "slewed";
  const cli::ClockFacts behind{
      .is_synchronised = true, .step_ms = 0, .now_us = 1'000'000'000, .recorded_us = 1'600'000'000};
  EXPECT_THAT(clock_finding(behind).what, HasSubstr("600 s behind"));
}

TEST(Doctor, JudgesTheDisk) {
  EXPECT_EQ(disk_finding({kRoomForAll, 3}, "disk").grade, cli::Grade::fine);
  EXPECT_EQ(disk_finding({kRoomForAll, 300}, "disk").grade, cli::Grade::note);
  const cli::Finding slow = disk_finding({kRoomForAll, 1500}, "disk");
  EXPECT_EQ(slow.grade, cli::Grade::problem);
  EXPECT_THAT(slow.what, HasSubstr("after 1500.0 ms"));
  const cli::Finding read_only = disk_finding({kRoomForAll, std::nullopt}, "disk");
  EXPECT_EQ(read_only.grade, cli::Grade::problem);
  EXPECT_THAT(read_only.what, HasSubstr("no file can be written"));
  EXPECT_EQ(disk_finding({kRoomForAll, 3}, "space").grade, cli::Grade::fine);
  EXPECT_THAT(disk_finding({1'000'000'000, 3}, "space").what, HasSubstr("low_space_mb = 2048"));
  EXPECT_THAT(disk_finding({100'000'000, 3}, "space").what, HasSubstr("critical_space_mb = 512"));
}

TEST(Redaction, RemovesSecretsInEveryFormAndLeavesWords) {
  cli::Redaction redaction;
  redaction.add_secret("known-word");
  redaction.add_secret("abc");  // too short to be one
  EXPECT_EQ(redaction.of("x known-word y abc"), "x [removed] y abc");
  EXPECT_EQ(redaction.of("open https://anna:pw@lab.example:8080/login?code=a1 now"),
            "open https://[removed]/login now");
  EXPECT_EQ(redaction.of("password=hunter2, done"), "password=[removed], done");
  EXPECT_EQ(redaction.of("Authorization: Bearer abc123"), "Authorization: [removed]");
  EXPECT_EQ(redaction.of("Authorization: Basic YTpi\nCookie: a=1; session=b\nnext"),
            "Authorization: [removed]\nCookie: [removed]\nnext");
  EXPECT_EQ(redaction.of("X-Token-Id: abc"), "X-Token-Id: [removed]");
  EXPECT_EQ(redaction.of("psk=hunter2"), "psk=[removed]");
  EXPECT_EQ(redaction.of("GET /foxglove?robot=r1&ticket=abc"), "GET /foxglove?robot=r1&ticket=[removed]");
  EXPECT_EQ(redaction.of("GET /login?code=a1 HTTP/1.1"), "GET /login?code=[removed] HTTP/1.1");
  EXPECT_EQ(redaction.of("a -----BEGIN KEY-----\nAAA\n-----END KEY----- b"), "a [removed] b");
  EXPECT_EQ(redaction.of("a -----BEGIN KEY-----\nAAA"), "a [removed]") << "one that was cut";
  EXPECT_THAT(redaction.of("9f86d081884c7d659a2feaa0c55ad015"), Not(HasSubstr("9f86")));
  EXPECT_EQ(redaction.of("acceleration_bias_walk_m_s2 10854675105700207240"),
            "acceleration_bias_walk_m_s2 10854675105700207240");
  EXPECT_EQ(redaction.of_own("rheonaut.token can be read"), "rheonaut.token can be read");
}

TEST(Redaction, RemovesTheValueAfterEachNameOfASecret) {
  const cli::Redaction redaction;
  for (const char* name : {"token", "password", "passwd", "secret", "bearer", "apikey", "api-key", "psk", "pwd",
                           "wifi key", "Wi-Fi PASSWORD", "token_hash", "code"}) {
    for (const char* between : {"=", ": ", " = \"", "=\\\""}) {
      const std::string text = std::string{"before "} + name + between + "hunter2\" after";
      if (std::string{name} == "code" && between[0] != '=') continue;
      EXPECT_THAT(redaction.of(text), AllOf(Not(HasSubstr("hunter2")), HasSubstr("before "), HasSubstr(" after")))
          << text;
    }
  }
}

TEST(Redaction, TakesAnyBytes) {
  const cli::Redaction redaction;
  for (const std::string& text :
       {std::string{}, std::string{"://"}, std::string{"token"}, std::string{"password="}, std::string{"-----BEGIN"},
        std::string{"-----BEGIN-----END"}, std::string(3, '\0'), std::string{"\xff\xfe://\xff?"},
        std::string{"http://a?b?c http://"}, std::string{"bearer bearer bearer"}}) {
    EXPECT_LE(redaction.of(text).size(), text.size() + 64);
  }
  EXPECT_THAT(redaction.of(std::string(1'000'000, 'a') + "1"), HasSubstr("1000001 characters"));
}

}  // namespace
}  // namespace server
