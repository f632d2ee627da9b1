// What outlives a reset: parameters and controller, unless a bit of them is wrong.
#include "robot_fw/core/settings_store.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "tests/robot_fw/controllers.hpp"
#include "tests/robot_fw/driven_robot.hpp"
#include "tests/robot_fw/memory_storage.hpp"

namespace robot_fw {
namespace {

using namespace sim_robot;

SimulatedRobotConfig with_storage(Storage& storage, DutyRange duty = {-1, 1}) {
  SimulatedRobotConfig config;
  config.storage = &storage;
  config.duty = duty;
  return with_boot_id(config);
}

// One boot of a robot that keeps its settings in `storage`.
struct Boot {
  explicit Boot(Storage& storage, DutyRange duty = {-1, 1}) : robot(with_storage(storage, duty)) {
    station.connect();
    station.run(2);
  }
  void order(const protocol::Command& command) {
    station.send(command);
    station.run(2);
  }
  SimulatedRobot robot;
  StationPeer station{robot};
};

class Settings : public ::testing::Test {
 protected:
  MemoryStorage storage;
};

TEST_F(Settings, ComeBackAfterAReset) {
  {
    Boot boot{storage};
    boot.order(set_parameter("auto_limit_s", 42));
    boot.order(set_controller(biquad_controller()));
  }
  Boot boot{storage};
  EXPECT_EQ(boot.station.hello->controller_id, 2u);
  EXPECT_EQ(boot.station.hello->controller_checksum, biquad_controller().checksum);
  boot.order(get_parameters(0));
  EXPECT_EQ(boot.station.pages[0].parameters[0].value, 42);
  EXPECT_NE(boot.station.hello->parameters_checksum, Parameters{}.checksum());
  ASSERT_EQ(boot.station.controllers.size(), 1u);  // what is in force, after the Welcome
  EXPECT_EQ(boot.station.controllers[0].controller_id, 2u);
}

// SAFETY: after a reset the robot may swim in another fluid; the model is kept, and is assumed again.
TEST_F(Settings, AModelIsOnlyAssumedAfterAReset) {
  {
    Boot boot{storage};
    boot.order(set_parameter("model_gain_4_m_s", 0.001F));
    boot.order(set_parameter("model_confirmed", 1));
  }
  Boot boot{storage};
  boot.order(get_parameters(static_cast<std::uint32_t>(*Parameters::find("model_gain_4_m_s"))));
  EXPECT_EQ(boot.station.pages[0].parameters[0].value, 0.001F);
  boot.order(get_parameters(static_cast<std::uint32_t>(*Parameters::find("model_confirmed"))));
  EXPECT_EQ(boot.station.pages[1].parameters[0].value, 0);
}

TEST_F(Settings, AfterAResetTheBuiltInControllerIsTheOneBefore) {
  Boot{storage}.order(set_controller(biquad_controller()));
  Boot boot{storage};
  boot.order(restore_controller());
  EXPECT_EQ(boot.station.controllers.back().controller_id, 1u);
  Boot next{storage};
  EXPECT_EQ(next.station.hello->controller_id, 1u);
}

TEST_F(Settings, AreWrittenOncePerChangeAndOnlyWithTheMotorOff) {
  Boot boot{storage};
  EXPECT_EQ(storage.saves, 0);
  boot.order(set_auto(0.1F));
  boot.order(set_parameter("auto_limit_s", 42));
  boot.order(set_controller(scaled_controller(7, 0.5F)));
  boot.station.run(200);
  EXPECT_EQ(storage.saves, 0);
  boot.order(set_manual());
  EXPECT_EQ(storage.saves, 2);
  boot.station.run(50);
  EXPECT_EQ(storage.saves, 2);
}

TEST_F(Settings, WithAnyBitWrongAreTheDefaults) {
  Boot{storage}.order(set_parameter("auto_limit_s", 42));
  Boot{storage}.order(set_controller(biquad_controller()));
  const auto sound = storage.values;
  ASSERT_EQ(sound.size(), 2u);
  const auto defaults = Boot{*std::make_unique<MemoryStorage>()}.station.hello;
  for (const auto& [key, bytes] : sound) {
    for (std::size_t bit = 0; bit < bytes.size() * 8; bit += 3) {
      storage.values = sound;
      storage.values[key][bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
      if (key == StorageKey::parameters) EXPECT_FALSE(load_parameters(storage)) << bit;
      if (key == StorageKey::controller) EXPECT_FALSE(load_controller(storage)) << bit;
    }
    storage.values[key].resize(bytes.size() - 1);
    Boot boot{storage};
    if (key == StorageKey::parameters) {
      EXPECT_EQ(boot.station.hello->parameters_checksum, defaults->parameters_checksum);
    } else {
      EXPECT_EQ(boot.station.hello->controller_checksum, defaults->controller_checksum);
    }
    storage.values = sound;
  }
}

// The CRC is right, the content is not: a firmware with other ranges wrote it.
TEST_F(Settings, OutOfTheirRangeAreTheDefaults) {
  Parameters parameters;
  parameters.set(0, 1e9F);
  save_parameters(storage, parameters);
  EXPECT_FALSE(load_parameters(storage));
  parameters.set(0, NAN);
  save_parameters(storage, parameters);
  EXPECT_FALSE(load_parameters(storage));
}

TEST_F(Settings, AStoredControllerMustFitTheMotorOfThisBoot) {
  Boot{storage}.order(set_controller(scaled_controller(7, 0.5F)));
  EXPECT_EQ(Boot(storage).station.hello->controller_id, 7u);
  const Boot one_way{storage, {0, 1}};
  EXPECT_EQ(one_way.station.hello->controller_id, kOneWayController.controller_id);
  const auto says_which = [](const protocol::Event& event) {
    return event.kind == rheonaut_EVENT_KIND_CONTROLLER_CHANGED &&
           event.value == static_cast<float>(kOneWayController.controller_id);
  };
  EXPECT_TRUE(std::ranges::any_of(one_way.station.events, says_which));
  auto unstable = scaled_controller(8, 0.5F);
  unstable.pole[0] = 2;
  save_controller(storage, with_checksum(unstable));
  EXPECT_EQ(Boot(storage).station.hello->controller_id, 1u);
}

int events_of(const StationPeer& station, protocol::EventKind kind, protocol::EventCause cause) {
  int count = 0;
  for (const auto& event : station.events) count += event.kind == kind && event.cause == cause;
  return count;
}

TEST_F(Settings, ThatDecayedAreAnEventOfTheBoot) {
  {
    Boot boot{storage};
    boot.order(set_parameter("auto_limit_s", 42));
    boot.order(set_controller(biquad_controller()));
    EXPECT_EQ(events_of(boot.station, rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_RESET), 0);
  }
  for (auto& [key, bytes] : storage.values) bytes.back() ^= 1;
  Boot boot{storage};
  EXPECT_EQ(events_of(boot.station, rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_RESET), 1);
  EXPECT_EQ(events_of(boot.station, rheonaut_EVENT_KIND_CONTROLLER_CHANGED, rheonaut_EVENT_CAUSE_RESET), 1);
}

TEST_F(Settings, OfAStorageThatIsDamagedAreAnEventOfTheBoot) {
  storage.is_damaged = true;
  Boot boot{storage};
  EXPECT_EQ(events_of(boot.station, rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_RESET), 1);
}

TEST_F(Settings, ThatCannotBeKeptAreAnEvent) {
  storage.is_full = true;
  Boot boot{storage};
  boot.order(set_parameter("auto_limit_s", 42));
  boot.order(set_controller(biquad_controller()));
  EXPECT_EQ(events_of(boot.station, rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_INTERNAL), 1);
  EXPECT_EQ(events_of(boot.station, rheonaut_EVENT_KIND_CONTROLLER_CHANGED, rheonaut_EVENT_CAUSE_INTERNAL), 1);
}

}  // namespace
}  // namespace robot_fw
