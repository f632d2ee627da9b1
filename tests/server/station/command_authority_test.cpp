// Control without robots: who may command, by leases and by how old the picture is.
#include "server/station/command_authority.hpp"

#include <gtest/gtest.h>

#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

class CommandAuthorityTest : public ::testing::Test {
 protected:
  static station::CommandRequest command(const std::string& actor, pb_size_t action = rheonaut_Command_set_duty_tag) {
    station::CommandRequest request;
    request.robot_id = "r1";
    request.actor = actor;
    request.action.which_action = action;
    return request;
  }
  Result<std::optional<station::Authority::Change>> take(const std::string& actor, microseconds age = microseconds{0}) {
    station::ControlRequest request;
    request.robot_id = "r1";
    request.actor = actor;
    request.age = age;
    return authority.change(request);
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  station::CommandAuthority authority{clock};
};

TEST_F(CommandAuthorityTest, WhoCommandsARobotThatNobodyControlsTakesControl) {
  ASSERT_TRUE(authority.may_command(command("anna")));
  const auto change = authority.on_commanded(command("anna"));
  ASSERT_TRUE(change.has_value());
  EXPECT_EQ(change->kind, "control_taken");
  EXPECT_FALSE(authority.on_commanded(command("anna")).has_value()) << "no change";
  EXPECT_EQ(authority.may_command(command("ben")).error().reason, "not_in_control");
  EXPECT_TRUE(authority.may_command(command("ben", rheonaut_Command_ping_tag))) << "it commands nothing";
}

TEST_F(CommandAuthorityTest, ByAnOldPictureNobodyTakesControlOrRenewsALease) {
  station::CommandRequest old = command("anna");
  old.life_from = "stamp";
  old.age = station::kOldestSight + microseconds{1};
  EXPECT_EQ(authority.check_sight(old).error().reason, "stale");
  EXPECT_FALSE(authority.on_commanded(old).has_value());
  EXPECT_EQ(take("anna", old.age).error().reason, "stale");
  ASSERT_TRUE(take("anna"));
  EXPECT_TRUE(authority.check_sight(old)) << "who is in control may say something else";
  old.action.which_action = rheonaut_Command_renew_lease_tag;
  EXPECT_EQ(authority.check_sight(old).error().reason, "stale");
}

TEST_F(CommandAuthorityTest, ControlEndsWithoutASignOfLifeAndAnOldPictureIsNone) {
  ASSERT_TRUE(take("anna"));
  clock.run_for(station::kControlLease / 2);
  authority.keep({"anna", ""}, "r1", microseconds{0});
  clock.run_for(station::kControlLease - microseconds{1'000});
  EXPECT_TRUE(authority.expire().empty());
  authority.keep({"anna", ""}, "r1", station::kOldestSight * 2);
  clock.run_for(microseconds{2'000});
  ASSERT_EQ(authority.expire().size(), 1u);
  EXPECT_EQ(authority.of("r1").holder, "");
}

}  // namespace
}  // namespace server
