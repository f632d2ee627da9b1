// A run as an .eln archive: what is in it, that it comes out again, and that nothing in it can change unnoticed.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "base/version.hpp"
#include "server/analysis/capsule/archive_reader.hpp"
#include "server/analysis/capsule/archive_writer.hpp"
#include "server/analysis/capsule/reproduction.hpp"
#include "server/runtime/sha256.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using analysis::Agreement;
using analysis::ArchiveReader;
using analysis::Reproduction;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kCapsule = "/api/v1/runs/1/capsule.eln";

class CapsuleTest : public ApiTest {
 protected:
  CapsuleTest() {
    std::string name = (fs::temp_directory_path() / "rheonaut-capsule-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make " + name};
    folder_ = name;
    connect_robot();
  }
  ~CapsuleTest() override { fs::remove_all(folder_); }

  // Two steps in auto, by a robot that follows its setpoint like a first-order lag.
  void record() {
    ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "two <steps>"}, {"operator_name", "Ada"}});
    float position_m = 0;
    for (std::uint64_t seq = 0; seq < 1000; seq += 25) {
      auto frame = TestRobot::samples_frame(seq, 25, 1'000'000 + seq * 10'000, 0);
      protocol::Telemetry& telemetry = frame.body.telemetry;
      telemetry.mode = rheonaut_MODE_AUTO;
      telemetry.has_setpoint_m = true;
      telemetry.setpoint_m = seq < 500 ? 0.1F : 0.05F;
      for (pb_size_t i = 0; i < 25; ++i) {
        telemetry.position_m[i] = position_m;
        position_m += 0.04F * (telemetry.setpoint_m - position_m);
        telemetry.duty[i] = 3 * (telemetry.setpoint_m - position_m);
      }
      robot->send(frame);
      clock.run_for(250ms);
    }
    ASSERT_EQ(ask("POST", "/api/v1/runs/1/end").status, 200);
  }
  fs::path save(const std::string& bytes, const std::string& name = "run.eln") {
    std::ofstream{folder_ / name, std::ios::binary} << bytes;
    return folder_ / name;
  }
  // Nothing of a damaged archive is believed.
  std::string fault_of(const fs::path& file) {
    try {
      const auto found = analysis::reproduce(file);
      if (!found) return found.error().detail;
      return found->faults.empty() ? "" : found->faults.front();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
  }
  static std::map<std::string, std::string> contents(const fs::path& file) {
    ArchiveReader archive{file};
    std::map<std::string, std::string> texts;
    for (const std::string& name : archive.names()) texts[name] = archive.text(name, 100'000'000).value();
    return texts;
  }
  std::ptrdiff_t left_behind() {
    clock.settle();
    if (!fs::exists(recording.exports_folder())) return 0;
    return std::distance(fs::directory_iterator{recording.exports_folder()}, {});
  }

  fs::path folder_;
};

TEST_F(CapsuleTest, HoldsTheRunAndComesOutAgainBitForBit) {
  record();
  const json model{{"kp", 0.1}, {"b1", 0.0057}, {"b2", 0.11}, {"alpha", 1.7}, {"beta", 0.87}};
  ask("POST", "/api/v1/designs", {{"kind", "model"}, {"name", "first"}, {"document", model}});
  ASSERT_EQ(
      ask("POST", "/api/v1/designs",
          {{"kind", "model"}, {"name", "second"}, {"document", model}, {"parent_id", 1}, {"runs", {{{"run_id", 1}}}}})
          .status,
      201);
  fs::path file;
  {
    const Answered answered = ask("GET", kCapsule);
    ASSERT_EQ(answered.status, 200) << answered.body;
    EXPECT_EQ(answered.response.content_type, "application/vnd.eln+zip");
    file = save(answered.body);
  }
  EXPECT_EQ(left_behind(), 0);
  auto texts = contents(file);
  std::vector<std::string> names;
  for (const auto& [name, text] : texts) names.push_back(name);
  EXPECT_THAT(names, ElementsAre("run-1/certificate.json", "run-1/configuration.json", "run-1/designs.json",
                                 "run-1/metrics.json", "run-1/report.html", "run-1/ro-crate-metadata.json",
                                 "run-1/run.json", "run-1/samples.csv", "run-1/samples.sqlite"));
  EXPECT_EQ(json::parse(texts["run-1/run.json"])["name"], "two <steps>");
  const json designs = json::parse(texts["run-1/designs.json"])["designs"];
  ASSERT_EQ(designs.size(), 1U);
  EXPECT_EQ(designs[0]["document"], model);
  EXPECT_EQ(designs[0]["ancestors"][0]["name"], "first");
  EXPECT_EQ(json::parse(texts["run-1/configuration.json"]), ask("GET", "/api/v1/runs/1/snapshot").parsed());
  EXPECT_EQ(texts["run-1/samples.csv"], ask("GET", "/api/v1/runs/1/samples.csv").body);

  const auto found = analysis::reproduce(file);
  ASSERT_TRUE(found) << found.error().detail;
  EXPECT_THAT(found->faults, ElementsAre());
  EXPECT_EQ(found->seal, analysis::Seal::whole);
  EXPECT_EQ(found->files, 8U);
  EXPECT_EQ(found->program, base::version());
  EXPECT_GT(found->results.size(), 40U);  // 16 figures, two steps of 15 values, three plots
  EXPECT_THAT(found->results, Each(::testing::Field(&analysis::Reproduced::agreement, Agreement::bit_for_bit)));
  EXPECT_TRUE(found->is_reproduced());
}

TEST_F(CapsuleTest, MetadataNamesEachFileWithItsHashAndTheProgramsThatMadeIt) {
  record();
  auto texts = contents(save(ask("GET", kCapsule).body));
  const json crate = json::parse(texts["run-1/ro-crate-metadata.json"]);
  std::map<std::string, json> entities;
  for (const json& entity : crate["@graph"]) entities[entity["@id"]] = entity;
  EXPECT_EQ(entities["ro-crate-metadata.json"]["conformsTo"]["@id"], "https://w3id.org/ro/crate/1.1");
  EXPECT_EQ(entities["./"]["hasPart"].size(), 8U);
  for (const json& part : entities["./"]["hasPart"]) {
    const json& file = entities[part["@id"]];
    const std::string& text = texts["run-1/" + part["@id"].get<std::string>()];
    EXPECT_EQ(file["sha256"], runtime::sha256_of(text)) << part;
    EXPECT_EQ(file["contentSize"], fmt::format("{}", text.size())) << part;
  }
  EXPECT_EQ(entities["#rheonaut"]["softwareVersion"], base::version());
  EXPECT_EQ(entities["#operator"]["name"], "Ada");
  EXPECT_EQ(entities["./"]["author"]["@id"], "#operator");
}

TEST_F(CapsuleTest, TheSameRunGivesTheSameBytes) {
  record();
  const std::string first = ask("GET", kCapsule).body;
  clock.run_for(3600s);
  EXPECT_TRUE(ask("GET", kCapsule).body == first);
}

TEST_F(CapsuleTest, EachFlippedByteIsFoundAndNamedByItsFile) {
  record();
  const std::string whole = ask("GET", kCapsule).body;
  ASSERT_EQ(fault_of(save(whole)), "");
  const auto step = [&](std::size_t at) { return at + 600 > whole.size() ? 13 : 1009; };  // the directory is at the end
  for (std::size_t at = 0; at < whole.size(); at += static_cast<std::size_t>(step(at))) {
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    EXPECT_NE(fault_of(save(flipped)), "") << "byte " << at << " of " << whole.size();
  }
  for (const char* name : {"run-1/samples.csv", "run-1/samples.sqlite", "run-1/metrics.json"}) {
    std::string flipped = whole;
    flipped[whole.find(name) + std::string{name}.size() + 40] ^= 1;  // of what is compressed
    EXPECT_THAT(fault_of(save(flipped)), HasSubstr(name));
  }
}

// Packed again with other numbers and their right hashes: the files are whole, and the numbers do not come out.
TEST_F(CapsuleTest, ANumberThatDoesNotComeOutIsNamed) {
  record();
  auto texts = contents(save(ask("GET", kCapsule).body));
  json metrics = json::parse(texts["run-1/metrics.json"]);
  const double rms = metrics["figures"]["duty_rms"], duration_s = metrics["figures"]["duration_s"];
  metrics["figures"]["duty_rms"] = rms * (1 + 1e-11);
  metrics["figures"]["duration_s"] = duration_s * (1 + 1e-6);
  const std::string old_hash = runtime::sha256_of(texts["run-1/metrics.json"]);
  texts["run-1/metrics.json"] = metrics.dump();
  std::string& crate = texts["run-1/ro-crate-metadata.json"];
  crate.replace(crate.find(old_hash), old_hash.size(), runtime::sha256_of(texts["run-1/metrics.json"]));
  analysis::ArchiveWriter writer{folder_ / "other.eln", 0};
  for (const auto& [name, text] : texts) {
    writer.begin(name);
    writer.add(text);
    writer.end();
  }
  writer.close();
  while (writer.seal()) continue;
  const auto found = analysis::reproduce(folder_ / "other.eln");
  ASSERT_TRUE(found) << found.error().detail;
  EXPECT_THAT(found->faults, ElementsAre());
  EXPECT_FALSE(found->is_reproduced());
  std::map<std::string, Agreement> agreements;
  for (const auto& result : found->results) agreements[result.name] = result.agreement;
  EXPECT_EQ(agreements["figures/duty_rms"], Agreement::within_tolerance);
  EXPECT_EQ(agreements["figures/duration_s"], Agreement::different);
  EXPECT_EQ(agreements["figures/gaps"], Agreement::bit_for_bit);
}

TEST_F(CapsuleTest, WhatIsNotInTheMetadataOrNotInTheArchiveIsNamed) {
  record();
  auto texts = contents(save(ask("GET", kCapsule).body));
  texts.erase("run-1/samples.csv");
  texts["run-1/more.txt"] = "smuggled";
  analysis::ArchiveWriter writer{folder_ / "other.eln", 0};
  for (const auto& [name, text] : texts) {
    writer.begin(name);
    writer.add(text);
    writer.end();
  }
  writer.close();
  while (writer.seal()) continue;
  const auto found = analysis::reproduce(folder_ / "other.eln");
  ASSERT_TRUE(found) << found.error().detail;
  EXPECT_THAT(found->faults,
              ElementsAre("run-1/samples.csv is not in the archive", "run-1/more.txt is not in the crate's metadata"));
}

TEST_F(CapsuleTest, RefusesARunThatHasNotEndedOrIsNotThere) {
  ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "open"}});
  make_samples(*robot, 0, 25);
  const Answered open = ask("GET", kCapsule);
  EXPECT_EQ(open.status, 409);
  EXPECT_EQ(open.parsed()["reason"], "run_is_open");
  EXPECT_EQ(ask("GET", "/api/v1/runs/9/capsule.eln").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/none/capsule.eln").status, 400);
  ask("POST", "/api/v1/runs/1/end");
  ASSERT_EQ(ask("POST", "/api/v1/runs/1/discard", {{"reason", "of another robot"}}).status, 200);
  EXPECT_EQ(ask("GET", kCapsule).parsed()["reason"], "discarded");
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("GET", kCapsule).status, 403);
  EXPECT_EQ(left_behind(), 0);
}

TEST(Reproduction, ComparesNumbersInText) {
  EXPECT_EQ(analysis::agreement_of("M1,2L3.5", "M1,2L3.5"), Agreement::bit_for_bit);
  EXPECT_EQ(analysis::agreement_of("M1,2L3.5", "M1,2L3.5000000001"), Agreement::within_tolerance);
  EXPECT_EQ(analysis::agreement_of("M1,2L3.5", "M1,2L3.50001"), Agreement::different);
  EXPECT_EQ(analysis::agreement_of("M1,2L3.5", "M1,2H3.5"), Agreement::different);
  EXPECT_EQ(analysis::agreement_of("M1,2L3.5", "M1,2L3.5 4"), Agreement::different);
  EXPECT_EQ(analysis::agreement_of("M1", ""), Agreement::different);
}

}  // namespace
}  // namespace server
