// One batch from the firmware's ring through the store into everything that shows samples: each field of the table is
// there, by its name and with its value. No field is named here but those of the ring that the test fills.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <matio.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "protocol/frame.hpp"
#include "robot_fw/core/telemetry_ring.hpp"
#include "server/api/bodies/column_text.hpp"
#include "server/live/state_json.hpp"
#include "server/storage/commits/sample_store.hpp"
#include "server/storage/export/csv_writer.hpp"
#include "server/storage/export/mat/mat_writer.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"
#include "server/storage/runs/run_digest.hpp"
#include "tests/server/telemetry/field_names.hpp"

namespace server {
namespace {

constexpr storage::RunId kRun = 1;
constexpr station::BootId kBoot = 7;
constexpr std::int64_t kBootKey = 1;

// A frame of three samples as the robot sends it, with no value 0.
protocol::Telemetry frame_of_firmware() {
  robot_fw::TelemetryRing ring;
  const robot_fw::BatchValues values{.emergency_id = 0xfedcba9876543210,
                                     .setpoint_m = 0.25F,
                                     .disturbance_m = 0.5F,
                                     .position_sd_m = 0.125F,
                                     .controller_id = 3,
                                     .flags = 64,
                                     .mode = 2,
                                     .sub_state = 1,
                                     .emergency_cause = 4,
                                     .has_setpoint = true};
  for (int sample = 1; sample <= 3; ++sample) {
    const auto at = static_cast<float>(sample);
    ring.push({at, at + 10, at + 20, at / 4, at + 40, at + 50}, values, false,
              static_cast<std::uint64_t>(sample) * 10'000, 10'000);
  }
  protocol::Telemetry frame;
  ring.read(0, 3, frame);
  return frame;
}

station::SampleBatch batch_of(const protocol::Telemetry& frame) {
  station::SampleBatch batch;
  batch.robot_id = "nemo";
  batch.boot_id = kBoot;
  batch.first_robot_time_us = frame.first_robot_time_us;
  batch.context = station::context_of(frame);
  copy_samples(frame, batch.samples);
  return batch;
}

class FieldExports : public ::testing::Test {
 protected:
  FieldExports() {
    std::string name = "/tmp/rheonaut-fields-XXXXXX";
    folder_ = mkdtemp(name.data());
    storage::Database database{path()};
    database.handle().exec(
        "INSERT INTO robot (robot_id, enrolled_at_us) VALUES ('nemo', 1);"
        "INSERT INTO boot (boot_key, boot_id, robot_id, reset_cause, firmware_version, sample_period_us,"
        " first_seen_at_us, announced_next_seq, last_robot_time_us) VALUES (1, 7, 'nemo', 'power_on', '', 10000, 1, 3, "
        "1);"
        "INSERT INTO run (run_id, robot_id, name, fluid, pump_profile, tube, operator_name, notes, verdict,"
        " firmware_version, controller_id, controller_checksum, parameters_checksum, started_at_us, ended_at_us)"
        " VALUES (1, 'nemo', '', '', '', '', '', '', '', '', 0, 0, 0, 1, 2);"
        "INSERT INTO run_span (run_id, span, boot_key, first_seq, last_seq) VALUES (1, 0, 1, 0, 2)");
    storage::WriteBatch commit;
    storage::Segment segment;
    segment.boot_key = kBootKey;
    segment.first_robot_time_us = batch_.first_robot_time_us;
    segment.context = batch_.context;
    segment.samples = batch_.samples;
    commit.segments.push_back(segment);
    storage::SampleStore{database}.write(commit);
  }
  ~FieldExports() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path path() const { return folder_ / "station.sqlite"; }

  // The second sample of the run, by whatever reads it, in a word for each field.
  using Words = std::map<std::string, std::string>;
  static std::string word(double value) {
    return std::isfinite(value) ? fmt::format("{}", static_cast<float>(value)) : "";
  }
  Words expected() const {
    Words words;
    const station::Sample& sample = batch_.samples.at(1);
    station::for_each_sample_field(
        [&](const station::SampleField& field) { words[field.name] = word(sample.*field.member); });
    station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
      const Value& value = batch_.context.*field.member;
      if constexpr (station::BatchField<Value>::kKind == station::FieldKind::number) {
        words[field.name] = word(station::or_nan(value));
      } else {
        words[field.name] = fmt::format("{}", station::text_or_value(value));
      }
    });
    return words;
  }
  // Those of `found` that are fields.
  static Words fields_of(const Words& found) {
    Words words;
    for (const Names& names : {sample_names(), batch_names()}) {
      for (const std::string& name : names) {
        if (found.contains(name)) words[name] = found.at(name);
      }
    }
    return words;
  }

  static std::string word(const nlohmann::json& value) {
    return value.is_number_float() ? word(value.get<double>())
           : value.is_string()     ? value.get<std::string>()
                                   : value.dump();
  }
  static Words words(const nlohmann::json& object) {
    Words words;
    for (const auto& [name, value] : object.items()) words[name] = word(value);
    return words;
  }

  std::filesystem::path folder_;
  station::SampleBatch batch_ = batch_of(frame_of_firmware());
  storage::ExportQuery query_{.run = kRun, .channels = storage::all_channels(), .grid_us = {}};
};

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in{line};
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

TEST_F(FieldExports, TheFirmwareFillsEveryFieldAndItsFrameDecodes) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_telemetry_tag;
  frame.body.telemetry = frame_of_firmware();
  std::array<std::uint8_t, protocol::kMaxFrameBytes> bytes;
  const std::size_t size = protocol::encode(frame, bytes.data(), bytes.size());
  const auto decoded = protocol::decode_robot_frame(protocol::Bytes{bytes.data(), size});
  ASSERT_TRUE(decoded) << "the columns of samples are not of one length";
  const protocol::Telemetry& telemetry = decoded->body.telemetry;
  station::for_each_sample_field(
      [&](const station::SampleField& field) { EXPECT_NE((telemetry.*field.wire)[1], 0.0F) << field.name; });
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    using Wire = station::BatchField<Value>::Wire;
    EXPECT_NE(telemetry.*field.wire, Wire{}) << field.name;
  });
}

TEST_F(FieldExports, ACsvHasAColumnForEachField) {
  SQLite::Database database = storage::open_for_reading(path());
  storage::CsvWriter writer{storage::read_spans(database, kRun, 0), query_};
  std::string text;
  while (const auto piece = writer.next(database)) text += *piece;
  std::istringstream in{text};
  std::string header, first, second;
  std::getline(in, header), std::getline(in, first), std::getline(in, second);
  const auto names = cells(header), values = cells(second);
  Words found;
  for (std::size_t column = 0; column < values.size(); ++column) found[names.at(column)] = values[column];
  EXPECT_EQ(fields_of(found), expected()) << text;
}

TEST_F(FieldExports, AMatFileHasAVariableForEachField) {
  SQLite::Database database = storage::open_for_reading(path());
  storage::MatWriter writer{folder_ / "run.mat", storage::read_spans(database, kRun, 0), query_};
  while (writer.advance(database).value()) continue;
  std::map<std::string, double> found;
  std::map<std::string, std::uint64_t> ids;
  const std::unique_ptr<mat_t, int (*)(mat_t*)> file{Mat_Open((folder_ / "run.mat").c_str(), MAT_ACC_RDONLY),
                                                     Mat_Close};
  ASSERT_NE(file, nullptr);
  while (matvar_t* read = Mat_VarReadNext(file.get())) {
    const std::unique_ptr<matvar_t, void (*)(matvar_t*)> variable{read, Mat_VarFree};
    if (read->class_type == MAT_C_SINGLE) found[read->name] = static_cast<double>(static_cast<float*>(read->data)[1]);
    if (read->class_type == MAT_C_UINT64) ids[read->name] = static_cast<std::uint64_t*>(read->data)[1];
    if (read->class_type == MAT_C_UINT32) found[read->name] = static_cast<std::uint32_t*>(read->data)[1];
  }
  const auto number = [&](const std::string& name) { return found.contains(name) ? found[name] : NAN; };
  station::for_each_sample_field([&](const station::SampleField& field) {
    EXPECT_EQ(number(field.name), static_cast<double>(batch_.samples[1].*field.member)) << field.name;
  });
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    const Value& value = batch_.context.*field.member;
    if constexpr (station::BatchField<Value>::kKind == station::FieldKind::number) {
      EXPECT_EQ(number(field.name), static_cast<double>(station::or_nan(value))) << field.name;
    } else if constexpr (station::BatchField<Value>::kKind == station::FieldKind::id) {
      EXPECT_EQ(ids[field.name], value) << field.name;
    } else {
      EXPECT_EQ(number(field.name), static_cast<double>(value)) << field.name;
    }
  });
}

TEST_F(FieldExports, ARunAsSqliteHasAColumnForEachField) {
  {
    SQLite::Database database = storage::open_for_reading(path());
    storage::RunFile writer{folder_ / "run.sqlite", storage::reading_uri(path(), false),
                            storage::read_spans(database, kRun, 0), query_};
    while (writer.advance(database)) continue;
  }
  SQLite::Database file{(folder_ / "run.sqlite").string(), SQLite::OPEN_READONLY};
  SQLite::Statement query{file, "SELECT * FROM sample WHERE seq = 1"};
  ASSERT_TRUE(query.executeStep());
  Words found;
  for (int column = 0; column < query.getColumnCount(); ++column) {
    const SQLite::Column value = query.getColumn(column);
    found[value.getName()] = value.isFloat() ? word(value.getDouble()) : value.getString();
  }
  EXPECT_EQ(fields_of(found), expected());
  SQLite::Statement unexplained{file, "SELECT name, column_name FROM about WHERE meaning = ''"};
  while (unexplained.executeStep()) {
    ADD_FAILURE() << unexplained.getColumn(0).getString() << "." << unexplained.getColumn(1).getString()
                  << " has no meaning in run_file_about.cpp";
  }
}

TEST_F(FieldExports, APageOfSamplesAndALiveMessageHaveEachField) {
  SQLite::Database database = storage::open_for_reading(path());
  const storage::SegmentPage page =
      read_segments(database, storage::read_spans(database, kRun, 0), {}, 10, storage::all_channels());
  EXPECT_EQ(fields_of(words(nlohmann::json::parse(api::page_text(page))["samples"][1])), expected());

  const auto live = nlohmann::json::parse(live::samples_message(batch_));
  Words found = words(live);
  for (const std::string& name : sample_names()) found[name] = word(live[name][1]);
  Words expected_live = expected();
  station::for_each_batch_field([&](const auto& field) {
    if (!field.is_in_live_samples) expected_live.erase(field.name);
  });
  EXPECT_EQ(fields_of(found), expected_live);
}

TEST_F(FieldExports, TheStateOfARobotHasEachField) {
  station::RobotState robot;
  robot.context = batch_.context;
  robot.sample = batch_.samples[1];
  const nlohmann::json state = live::to_json(robot);
  Words found = words(state);
  found.merge(words(state["sample"]));
  EXPECT_EQ(fields_of(found), expected());
}

TEST_F(FieldExports, TheToolsReadEachField) {
  const auto samples = storage::read_run(path(), kRun, 10);
  ASSERT_TRUE(samples);
  ASSERT_EQ(samples->size(), 3u);
  EXPECT_EQ(samples->at(1).sample, batch_.samples[1]);
  station::SampleContext context = samples->at(1);
  context.period_us = batch_.context.period_us;  // which is not in the view
  EXPECT_EQ(context, batch_.context);
}

// A field that a digest does not contain could be changed unseen.
TEST_F(FieldExports, TheDigestOfTheNewestFormatChangesWithEachField) {
  storage::Segment segment;
  segment.context = batch_.context;
  segment.samples = batch_.samples;
  const auto digest = [](const storage::Segment& of) {
    storage::SampleHash hash{storage::kDigestFormat};
    hash.add(kBoot, of);
    return hash.text();
  };
  station::for_each_sample_field([&](const station::SampleField& field) {
    storage::Segment changed = segment;
    changed.samples[1].*field.member += 1;
    EXPECT_NE(digest(changed), digest(segment)) << field.name;
  });
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    storage::Segment changed = segment;
    changed.context.*field.member = Value{};
    EXPECT_NE(digest(changed), digest(segment)) << field.name;
  });
}

}  // namespace
}  // namespace server
