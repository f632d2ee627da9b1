// The enumerators of the document are the texts that the station can answer with, both ways. A text that is not among
// them makes the whole answer invalid for a client that was generated from the document.
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "server/analysis/metrics/run_steps.hpp"
#include "server/identity/account.hpp"
#include "server/station/state/station_state.hpp"
#include "server/storage/runs/outside_reference.hpp"
#include "server/storage/runs/run.hpp"
#include "server/storage/upkeep/backup.hpp"
#include "server/storage/upkeep/disk_watch.hpp"
#include "tests/server/api/openapi_document.hpp"

namespace server {
namespace {

using Texts = std::set<std::string>;

// Whatever text() says of some number: those of the enumerators, and of what a newer firmware sends.
template <class Enumerator>
Texts possible() {
  using protocol::text;
  Texts texts;
  for (int number = 0; number < 256; ++number) texts.insert(text(static_cast<Enumerator>(number)));
  texts.erase("");
  return texts;
}

// Of "Mode", a schema, or of "Robot.link", one of its properties.
Texts documented(const std::string& name) {
  static const nlohmann::json kDocument = openapi_document();
  const auto dot = name.find('.');
  nlohmann::json schema = kDocument["components"]["schemas"].at(name.substr(0, dot));
  if (dot != std::string::npos) schema = schema.at("properties").at(name.substr(dot + 1));
  Texts texts;
  for (const nlohmann::json& text : schema.at("enum")) texts.insert(text.get<std::string>());
  return texts;
}

TEST(OpenapiEnumerators, AreTheTextsOfTheProtocol) {
  EXPECT_EQ(documented("Mode"), possible<protocol::Mode>());
  EXPECT_EQ(documented("SubState"), possible<protocol::SubState>());
  EXPECT_EQ(documented("EmergencyCause"), possible<protocol::EmergencyCause>());
  EXPECT_EQ(documented("Robot.reset_cause"), possible<protocol::ResetCause>());
}

TEST(OpenapiEnumerators, AreTheTextsOfTheStation) {
  EXPECT_EQ(documented("Role"), possible<identity::Role>());
  EXPECT_EQ(documented("Robot.link"), possible<station::LinkState>());
  EXPECT_EQ(documented("RobotToStop.link"), possible<station::LinkState>());
  EXPECT_EQ(documented("RobotModel.state"), possible<station::ModelState>());
  EXPECT_EQ(documented("Command.state"), possible<station::CommandState>());
}

TEST(OpenapiEnumerators, AreTheTextsOfWhatIsRecorded) {
  EXPECT_EQ(documented("RunState"), possible<storage::RunState>());
  EXPECT_EQ(documented("Recording.space"), possible<storage::SpaceState>());
  EXPECT_EQ(documented("Backup.state"), possible<storage::BackupState>());
  EXPECT_EQ(documented("Reference.clock_method"), possible<storage::ReferenceClock>());
  EXPECT_EQ(documented("Step.cause"), possible<analysis::StepCause>());
}

}  // namespace
}  // namespace server
