// The enumerators of the document are the texts that the station can answer with, both ways. A text that is not among
// them makes the whole answer invalid for a client that was generated from the document.
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "server/analysis/run_steps.hpp"
#include "server/identity/account.hpp"
#include "server/station/state/station_state.hpp"
#include "server/storage/runs/outside_reference.hpp"
#include "server/storage/runs/run.hpp"
#include "server/storage/upkeep/backup.hpp"
#include "server/storage/upkeep/disk_watch.hpp"

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

std::string whole_document() {
  std::ifstream in{OPENAPI_YAML};
  return {std::istreambuf_iterator<char>{in}, {}};
}

// The lines from `name:`, at this indentation, to the next that is indented no further.
std::string section(const std::string& lines, std::size_t indentation, const std::string& name) {
  std::istringstream in{lines};
  std::string line, found;
  while (std::getline(in, line)) {
    const bool is_inside = line.empty() || line.find_first_not_of(' ') > indentation;
    if (!found.empty() && !is_inside) break;
    if (!found.empty() || line.starts_with(std::string(indentation, ' ') + name + ":")) found += line + '\n';
  }
  return found;
}

// Of "Mode", a schema, or of "Robot.link", one of its properties.
Texts documented(const std::string& name) {
  const auto dot = name.find('.');
  std::string lines = section(whole_document(), 4, name.substr(0, dot));
  if (dot != std::string::npos) lines = section(lines, 8, name.substr(dot + 1));
  const auto begin = lines.find("enum: [") + 7;
  std::istringstream list{lines.substr(std::min(begin, lines.size()), lines.find(']', begin) - begin)};
  Texts texts;
  for (std::string text; std::getline(list >> std::ws, text, ',');) texts.insert(text);
  return texts;
}

TEST(OpenapiEnumerators, AreTheTextsOfTheProtocol) {
  EXPECT_EQ(documented("Mode"), possible<protocol::Mode>());
  EXPECT_EQ(documented("SubState"), possible<protocol::SubState>());
  EXPECT_EQ(documented("EmergencyCause"), possible<protocol::EmergencyCause>());
  EXPECT_EQ(documented("Robot.reset_cause"), possible<protocol::ResetCause>());
}

TEST(OpenapiEnumerators, AreTheTextsOfTheStation) {
  EXPECT_EQ(documented("Role"), possible<Role>());
  EXPECT_EQ(documented("Robot.link"), possible<LinkState>());
  EXPECT_EQ(documented("RobotToStop.link"), possible<LinkState>());
  EXPECT_EQ(documented("RobotModel.state"), possible<ModelState>());
  EXPECT_EQ(documented("Command.state"), possible<CommandState>());
}

TEST(OpenapiEnumerators, AreTheTextsOfWhatIsRecorded) {
  EXPECT_EQ(documented("RunState"), possible<RunState>());
  EXPECT_EQ(documented("Recording.space"), possible<SpaceState>());
  EXPECT_EQ(documented("Backup.state"), possible<BackupState>());
  EXPECT_EQ(documented("Reference.clock_method"), possible<ReferenceClock>());
  EXPECT_EQ(documented("Step.cause"), possible<StepCause>());
}

}  // namespace
}  // namespace server
