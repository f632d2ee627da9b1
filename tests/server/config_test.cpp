// The configuration: precedence, the documented file, and what is said about mistakes.
#include "server/config/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class ConfigTest : public ::testing::Test {
 public:
  ConfigTest() {
    std::string name = (std::filesystem::temp_directory_path() / "rheonaut-config-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + name};
    folder_ = name;
  }
  ~ConfigTest() override { std::filesystem::remove_all(folder_); }

 protected:
  config::ConfigFlags file(const std::string& content) {
    std::ofstream{folder_ / "station.toml"} << content;
    config::ConfigFlags flags;
    flags.file = folder_ / "station.toml";
    return flags;
  }

  std::string mistake(const std::string& content) {
    try {
      load_config(file(content));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "no mistake was found";
  }

 private:
  std::filesystem::path folder_;
};

TEST_F(ConfigTest, DefaultsListenOnLoopbackOnly) {
  const config::Config config = config::load_config({});
  EXPECT_EQ(config.http, "127.0.0.1:8080");
  EXPECT_EQ(config.robots, "127.0.0.1:7070");
  EXPECT_TRUE(config.http_or_any_port && config.robots_or_any_port);
}

TEST_F(ConfigTest, TheDocumentedFileHoldsEveryDefault) {
  config::ConfigFlags flags;
  flags.file = std::filesystem::path{TEST_DATA_DIR} / "../../deploy/rheonaut.toml";
  const config::Config from_file = load_config(flags);
  const config::Config defaults;
  EXPECT_EQ(from_file.data_dir, defaults.data_dir);
  EXPECT_EQ(from_file.http, defaults.http);
  EXPECT_EQ(from_file.http_hosts, defaults.http_hosts);
  EXPECT_EQ(from_file.robots, defaults.robots);
  EXPECT_EQ(from_file.enrolment.allowed, defaults.enrolment.allowed);
  EXPECT_EQ(from_file.enrolment.most_robots, defaults.enrolment.most_robots);
  EXPECT_EQ(from_file.enrolment.most_a_minute, defaults.enrolment.most_a_minute);
  EXPECT_EQ(from_file.http_places.connections, defaults.http_places.connections);
  EXPECT_EQ(from_file.http_places.of_address, defaults.http_places.of_address);
  EXPECT_EQ(from_file.robot_places.connections, defaults.robot_places.connections);
  EXPECT_EQ(from_file.robot_places.of_address, defaults.robot_places.of_address);
  EXPECT_EQ(from_file.tls.mode, defaults.tls.mode);
  EXPECT_EQ(from_file.tls.certificate, defaults.tls.certificate);
  EXPECT_EQ(from_file.tls.key, defaults.tls.key);
  EXPECT_EQ(from_file.tls.insecure, defaults.tls.insecure);
  EXPECT_EQ(from_file.link.link_timeout_ms, defaults.link.link_timeout_ms);
  EXPECT_EQ(from_file.link.heartbeat_interval_ms, defaults.link.heartbeat_interval_ms);
  EXPECT_EQ(from_file.link.samples_per_frame, defaults.link.samples_per_frame);
  EXPECT_EQ(from_file.envelope.anywhere(), defaults.envelope.anywhere());
  EXPECT_EQ(from_file.envelope.of_fluid(), defaults.envelope.of_fluid());
  EXPECT_EQ(from_file.recording.retention_days, defaults.recording.retention_days);
  EXPECT_EQ(from_file.recording.event_retention_days, defaults.recording.event_retention_days);
  EXPECT_EQ(from_file.recording.give_up_after_days, defaults.recording.give_up_after_days);
  EXPECT_EQ(from_file.recording.max_database_mb, defaults.recording.max_database_mb);
  EXPECT_EQ(from_file.recording.low_space_mb, defaults.recording.low_space_mb);
  EXPECT_EQ(from_file.recording.critical_space_mb, defaults.recording.critical_space_mb);
  EXPECT_EQ(from_file.recording.backup_dir, defaults.recording.backup_dir);
  EXPECT_EQ(from_file.any_file_system, defaults.any_file_system);
  EXPECT_EQ(from_file.experiments.allow_unattended, defaults.experiments.allow_unattended);
  EXPECT_EQ(from_file.experiments.back_within_s, defaults.experiments.back_within_s);
  EXPECT_EQ(from_file.foxglove, defaults.foxglove);
  EXPECT_EQ(from_file.real_time, defaults.real_time);
  EXPECT_EQ(from_file.log_level, defaults.log_level);
  EXPECT_EQ(from_file.log_format, defaults.log_format);
}

// The error for an unknown option lists all known ones, so each of them can be looked for in the documented file.
TEST_F(ConfigTest, TheDocumentedFileNamesEveryOption) {
  std::string known = mistake("[log]\nlevle = \"info\"\n");
  ASSERT_THAT(known, HasSubstr("known are "));
  std::ifstream in{std::filesystem::path{TEST_DATA_DIR} / "../../deploy/rheonaut.toml"};
  std::stringstream documented;
  documented << in.rdbuf();
  std::istringstream options{known.substr(known.find("known are ") + 10)};
  int count = 0;
  for (std::string option; std::getline(options >> std::ws, option, ','); ++count) {
    const auto dot = option.find('.');
    EXPECT_THAT(documented.str(), HasSubstr("[" + option.substr(0, dot) + "]"));
    EXPECT_THAT(documented.str(), HasSubstr("\n" + option.substr(dot + 1) + " = "));
  }
  EXPECT_GE(count, 19);
}

TEST_F(ConfigTest, FlagsGoBeforeTheFileAndMakeAPortBinding) {
  config::ConfigFlags flags = file("[http]\nlisten = \"127.0.0.1:9000\"\n[robots]\nlisten = \"127.0.0.1:9001\"\n");
  flags.robots = "127.0.0.1:0";
  const config::Config config = load_config(flags);
  EXPECT_EQ(config.http, "127.0.0.1:9000");
  EXPECT_EQ(config.robots, "127.0.0.1:0");
  EXPECT_FALSE(config.http_or_any_port);
  EXPECT_FALSE(config.robots_or_any_port);
}

TEST_F(ConfigTest, MistakesNameFileLineOptionAndRemedy) {
  EXPECT_THAT(mistake("[log]\nlevel = \"loud\"\n"), HasSubstr("station.toml:2: log.level = 'loud' must be one of"));
  EXPECT_THAT(mistake("[log]\nformat = \"xml\"\n"),
              HasSubstr("station.toml:2: log.format = 'xml' must be text or json"));
  EXPECT_THAT(mistake("[robots]\n\nlink_timeout_ms = 5\n"), HasSubstr(":3: robots.link_timeout_ms = 5 is outside 200"));
  EXPECT_THAT(mistake("[robots]\nlink_timeout_ms = \"1\"\n"), HasSubstr("must be a whole number"));
  EXPECT_THAT(mistake("[robots]\nenrol_on_loopback = 1\n"), HasSubstr("must be true or false"));
  EXPECT_THAT(mistake("[limits]\nduty_max = nan\n"), HasSubstr("is outside 0 to 1"));
  EXPECT_THAT(mistake("[limits]\nsetpoint_min_m = 2.0\n"), HasSubstr("must be below"));
  EXPECT_THAT(mistake("[recording]\nretention_days = -1\n"), HasSubstr("retention_days = -1 is outside 0 to 36500"));
  EXPECT_THAT(mistake("[recording]\nevent_retention_days = 36501\n"),
              HasSubstr("event_retention_days = 36501 is outside 0 to 36500"));
  EXPECT_THAT(mistake("[recording]\ngive_up_after_days = 0.5\n"),
              HasSubstr("recording.give_up_after_days must be a whole number"));
  EXPECT_THAT(mistake("[recording]\ngive_up_after_days = -1\n"),
              HasSubstr("give_up_after_days = -1 is outside 0 to 36"));
  EXPECT_THAT(mistake("[recording]\ncritical_space_mb = 3000\n"), HasSubstr("must be at most recording.low_space_mb"));
  EXPECT_THAT(mistake("[http]\nlisten = \"here\"\n"), HasSubstr("'here' is not ADDR:PORT"));
  EXPECT_THAT(mistake("[http]\nmax_connections = 15\n"), HasSubstr("http.max_connections = 15 is outside 16 to 32768"));
  EXPECT_THAT(mistake("[robots]\nmax_connections_per_address = 0\n"),
              HasSubstr("robots.max_connections_per_address = 0 is outside 1 to 32768"));
  EXPECT_THAT(mistake("[http]\nhosts = [1]\n"), HasSubstr("must be an array of texts"));
  EXPECT_THAT(mistake("[http\n"), HasSubstr("station.toml:1:"));
  EXPECT_THAT(mistake("level = 1\n"), HasSubstr("outside a section"));
}

TEST_F(ConfigTest, AFluidHasTheLimitsItNamesAndTheGeneralOnesElse) {
  const config::Config config = load_config(file("[limits]\nduty_max = 0.8\n[limits.water]\nsetpoint_step_m = 0.05\n"));
  EXPECT_EQ(config.envelope.in("water").setpoint_step_m, 0.05);
  EXPECT_EQ(config.envelope.in("water").duty_max, 0.8);
  EXPECT_EQ(config.envelope.in("non_newtonian").setpoint_step_m, config::CommandLimits{}.setpoint_step_m);
  EXPECT_EQ(config.envelope.in("non_newtonian").duty_max, 0.8);
  EXPECT_THAT(mistake("[limits.water]\nduty_mx = 1.0\n"), HasSubstr(":2: unknown option 'limits.water.duty_mx'"));
  EXPECT_THAT(mistake("[limits.water]\nduty_max = 2.0\n"), HasSubstr("limits.water.duty_max = 2 is outside 0 to 1"));
  EXPECT_THAT(mistake("[limits.water]\nsetpoint_min_m = 1.0\n"), HasSubstr("limits.water.setpoint_min_m = 1 must be"));
  EXPECT_THAT(mistake("[data.water]\ndir = 'x'\n"), HasSubstr("unknown option 'data.water'"));
}

TEST_F(ConfigTest, AFleetMayEnrolItselfWhereTheConfigurationForLoadTestsSaysSo) {
  EXPECT_EQ(config::Config{}.enrolment.most_robots, 64U);
  EXPECT_EQ(config::Config{}.enrolment.most_a_minute, 10U);
  config::ConfigFlags flags;
  flags.file = std::filesystem::path{TEST_DATA_DIR} / "../../deploy/fleet.toml";
  EXPECT_EQ(load_config(flags).enrolment.most_robots, 100'000U);
  EXPECT_EQ(load_config(flags).enrolment.most_a_minute, 100'000U);
  EXPECT_THAT(mistake("[robots]\nenrolments_per_minute = 0\n"), HasSubstr("enrolments_per_minute = 0 is outside 1 to"));
  EXPECT_THAT(mistake("[robots]\nmax_enrolled_on_loopback = -1\n"), HasSubstr("_loopback = -1 is outside 0 to 100000"));
}

TEST_F(ConfigTest, EachSectionOfAFluidListsItWithoutRegardToCaseAndBlanks) {
  const config::Config config = load_config(
      file("[limits.Water]\nduty_max = 0.5\n[limits.\" Xanthan 0.5 % \"]\nduty_max = 0.6\n[fluids.Glycerine]\n"
           "[fluids.WATER]\n"));
  std::vector<std::string> fluids;
  for (const auto& [fluid, limits] : config.envelope.of_fluid()) fluids.push_back(fluid);
  EXPECT_THAT(fluids, ElementsAre("glycerine", "non_newtonian", "water", "xanthan 0.5 %"));
  EXPECT_EQ(config.envelope.in("water").duty_max, 0.5) << "those of [limits.Water]";
  EXPECT_EQ(config.envelope.in("glycerine"), config.envelope.anywhere());
  EXPECT_EQ(config.envelope.in("").duty_max, 0.5) << "the strictest where it is not known";
  EXPECT_THAT(mistake("[limits.Water]\n[limits.water]\n"), HasSubstr("names a fluid that another section has named"));
  EXPECT_THAT(mistake("[limits.\" \"]\nduty_max = 0.5\n"), HasSubstr("must have a fluid's name of 1 to 40 bytes"));
  EXPECT_THAT(mistake("[fluids.oil]\nduty_max = 0.5\n"), HasSubstr(":2: unknown option 'fluids.oil.duty_max'"));
  EXPECT_THAT(mistake("[fluids]\noil = 1\n"), HasSubstr(":2: unknown option 'fluids.oil'"));
}

TEST_F(ConfigTest, AMissingFileIsAMistake) {
  config::ConfigFlags flags;
  flags.file = "no/such/file.toml";
  EXPECT_THROW(load_config(flags), std::invalid_argument);
}

TEST_F(ConfigTest, TlsIsSpokenWhereOtherMachinesListenUnlessSomebodySaysOtherwise) {
  const std::string listen = "[http]\nlisten = '192.0.2.1:8080'\n[robots]\nlisten = '[::1]:7070'\n[tls]\n";
  const config::Config automatic = load_config(file(listen));
  EXPECT_TRUE(automatic.speaks_tls(automatic.http) && !automatic.speaks_tls(automatic.robots));
  EXPECT_FALSE(automatic.is_exposed(automatic.http) || automatic.is_exposed(automatic.robots));
  const config::Config on = load_config(file(listen + "mode = 'on'"));
  EXPECT_TRUE(on.speaks_tls(on.http) && on.speaks_tls(on.robots));
  for (const char* plain : {"insecure = true", "mode = 'off'\ninsecure = true"}) {
    const config::Config insecure = load_config(file(listen + plain));
    EXPECT_FALSE(insecure.speaks_tls(insecure.http) || insecure.speaks_tls(insecure.robots));
    EXPECT_TRUE(insecure.is_exposed(insecure.http) && !insecure.is_exposed(insecure.robots));
  }
}

TEST_F(ConfigTest, PlainTcpBeyondLoopbackNeedsAClearWord) {
  const std::string refused = mistake("[robots]\nlisten = '0.0.0.0:7070'\n[tls]\nmode = 'off'");
  EXPECT_THAT(refused, HasSubstr("robots.listen = '0.0.0.0:7070'"));
  EXPECT_THAT(refused, HasSubstr("rheonaut certificate"));
  EXPECT_THAT(refused, HasSubstr("tls.insecure = true"));
  EXPECT_THAT(mistake("[tls]\nmode = 'on'\ninsecure = true"), HasSubstr("contradict"));
  EXPECT_THAT(mistake("[tls]\nmode = 'yes'"), HasSubstr("must be one of auto, on, off"));
  EXPECT_THAT(mistake("[tls]\ncertificate = 'a.crt'"), HasSubstr("belong together"));
}

}  // namespace
}  // namespace server
