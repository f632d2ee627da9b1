// The lists of fields in openapi.yaml, docs/database.md and docs/protocol.md against the table.
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <regex>
#include <sstream>

#include "tests/server/telemetry/field_names.hpp"

namespace server {
namespace {

std::string joined(const Names& names, const char* separator) { return fmt::format("{}", fmt::join(names, separator)); }

// From `begin` up to the next `end`, each run of white space as one space.
std::string passage(const std::string& file, const std::string& begin, const std::string& end) {
  const std::string text = project_file(file);
  const std::size_t at = text.find(begin);
  if (at == std::string::npos) return {};
  const std::size_t stop = text.find(end, at + begin.size());
  return std::regex_replace(text.substr(at, stop - at), std::regex{R"(\s+)"}, " ");
}

// A schema of openapi.yaml up to the next one.
std::string schema(const std::string& name) {
  const std::string text = project_file("server/api/openapi.yaml");
  const std::string head = "\n    " + name + ":\n";
  const std::size_t at = text.find(head);
  if (at == std::string::npos) return {};
  const std::string rest = text.substr(at + head.size() - 1);
  std::smatch next;
  const bool is_last = !std::regex_search(rest, next, std::regex{R"(\n    \w+:\n)"});
  return is_last ? rest : rest.substr(0, static_cast<std::size_t>(next.position()));
}

// The names in the first `required: [...]` of a schema.
Names required(const std::string& schema_text) {
  const std::size_t begin = schema_text.find("required: [") + 11;
  std::string list = schema_text.substr(begin, schema_text.find(']', begin) - begin);
  std::erase_if(list, [](char c) { return c == ' ' || c == '\n'; });
  std::istringstream in{list};
  Names names;
  for (std::string name; std::getline(in, name, ',');) names.push_back(name);
  return names;
}

void expect_in(const Names& names, const std::string& schema_name) {
  const std::string text = schema(schema_name);
  const Names listed = required(text);
  for (const std::string& name : names) {
    EXPECT_NE(std::ranges::find(listed, name), listed.end()) << schema_name << " does not require " << name;
    EXPECT_NE(text.find("  " + name + ": {"), std::string::npos) << schema_name << " does not describe " << name;
  }
}

TEST(TelemetryFieldsInOpenapi, AreThoseOfASample) {
  EXPECT_EQ(required(schema("Sample")), sample_names());
  expect_in(sample_names(), "Sample");
}

TEST(TelemetryFieldsInOpenapi, AreInStatesPagesAndLiveMessages) {
  expect_in(batch_names(), "Robot");
  expect_in(batch_names(), "StoredSample");
  expect_in(sample_names(), "LiveSamples");
  Names live;
  station::for_each_batch_field([&](const auto& field) {
    if (field.is_in_live_samples) live.emplace_back(field.name);
  });
  expect_in(live, "LiveSamples");
}

TEST(TelemetryFieldsInOpenapi, AreTheColumnsOfTheCsvInTheirOrder) {
  const std::string columns = passage("server/api/openapi.yaml", "Columns span, boot_id", "An empty field");
  const Names batch = batch_names();
  const Names before_times{batch.begin(), batch.begin() + 4};
  const Names after_times{batch.begin() + 4, batch.end()};
  EXPECT_NE(
      columns.find(fmt::format("utc (RFC 3339), {}, {}, clock_uncertainty_us, first_received_at_us, "
                               "received_at_us, {}, gap_before",
                               joined(sample_names(), ", "), joined(before_times, ", "), joined(after_times, ", "))),
      std::string::npos)
      << columns;
}

TEST(TelemetryFieldsInOpenapi, AreTheColumnsOfAnOverview) {
  const std::string text = schema("Overview");
  for (const std::string& name : sample_names()) {
    EXPECT_NE(text.find("  " + name + ": { $ref: '#/components/schemas/ExtremeColumns' }"), std::string::npos) << name;
  }
}

TEST(TelemetryFieldsInDatabaseDocument, AreTheChannelsAndTheColumnsOfTheView) {
  EXPECT_NE(passage("docs/database.md", "channels: `", "(the setpoint").find('`' + joined(sample_names(), ", ") + '`'),
            std::string::npos);
  const std::string view = passage("docs/database.md", "| `run_sample` |", "\n");
  EXPECT_NE(view.find(joined(batch_names(), ", ")), std::string::npos) << view;
}

TEST(TelemetryFieldsInDatabaseDocument, AreTheBytesOfADigestInTheirOrder) {
  std::string fields;
  const auto add = [&](const auto& field) { fields += fmt::format("`{}` ", field.name); };
  station::for_each_batch_field_of<station::FieldKind::number>(add);
  station::for_each_batch_field_of<station::FieldKind::enumerator>(add);
  station::for_each_batch_field_of<station::FieldKind::count>(add);
  station::for_each_batch_field_of<station::FieldKind::id>(add);
  const std::string table = passage("docs/database.md", "the six channels as binary32", "That is `format`");
  std::string listed;
  const std::regex quoted{"`[a-z_]+`"};
  for (std::sregex_iterator at{table.begin(), table.end(), quoted}, end; at != end; ++at) {
    if (at->str() != "`unknown_values`") listed += at->str() + ' ';
  }
  EXPECT_EQ(listed, fields);
}

TEST(TelemetryFieldsInProtocolDocument, HaveARowEachOrStandInOne) {
  const std::string samples = passage("docs/protocol.md", "| per sample | meaning |", "| per batch");
  for (const std::string& name : sample_names())
    EXPECT_NE(samples.find("| `" + name + "` |"), std::string::npos) << name;
  const std::string batch = passage("docs/protocol.md", "| per batch | meaning |", "| flag | bit");
  for (const std::string& name : batch_names()) EXPECT_NE(batch.find('`' + name + '`'), std::string::npos) << name;
}

}  // namespace
}  // namespace server
