// One recording, and the same numbers wherever it is read: in the database, by the API, as CSV, MAT and SQLite.
#include <fmt/format.h>
#include <matio.h>

#include <bit>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "server/api/column_text.hpp"
#include "server/cli/export.hpp"
#include "server/recording/csv_writer.hpp"
#include "server/recording/database.hpp"
#include "server/recording/mat_writer.hpp"
#include "server/recording/run_file.hpp"
#include "server/recording/run_reader.hpp"
#include "server/recording/schema.hpp"
#include "tests/server/recording/random_recording.hpp"

namespace server {
namespace {

// As binary32, so that not a bit is lost; every NaN is the same.
std::string bits(float value) {
  return std::isnan(value) ? "none" : fmt::format("{:08x}", std::bit_cast<std::uint32_t>(value));
}
std::string bits_of(const std::string& text) {
  return text.empty() ? "none" : bits(std::strtof(text.c_str(), nullptr));
}

using Lines = std::vector<std::string>;  // a sample each: whole numbers and words as text, floats as bits

std::vector<std::string> split(const std::string& line, char separator) {
  std::vector<std::string> fields;
  std::istringstream in{line};
  for (std::string field; std::getline(in, field, separator);) fields.push_back(field);
  if (!line.empty() && line.back() == separator) fields.emplace_back();
  return fields;
}

std::string joined(const std::vector<std::string>& fields) { return fmt::format("{}", fmt::join(fields, " ")); }

class ExportTest : public RandomRecordingTest {
 protected:
  std::vector<RecordedSpan> spans_of(RunId run) {
    auto spans = wait(recording_->exports.spans(excerpt_of(run))).value();
    for (RecordedSpan& span : spans) span.cut(span.made());
    return spans;
  }

  std::string csv(const ExportQuery& query) {
    SQLite::Database database = open_for_reading(path_);
    CsvWriter writer{spans_of(query.run), query};
    std::string text;
    while (const auto piece = writer.next(database)) text += *piece;
    return text;
  }

  // By the history of the readers, with what waits.
  Lines api_lines(RunId run) {
    Lines lines;
    std::optional<StoredSample> last;
    const auto spans = spans_of(run);
    for (const StoredSample& stored : samples_of(run)) {
      const bool follows = last && last->span == stored.span;
      const std::uint64_t expected = follows ? last->seq + 1 : spans.at(stored.span).samples.first;
      lines.push_back(line_of(stored, stored.seq - expected));
      last = stored;
    }
    return lines;
  }

  static std::string line_of(const StoredSample& stored, std::uint64_t gap_before) {
    std::vector<std::string> fields{
        fmt::format("{} {} {} {} {}", stored.span, stored.boot_id, stored.seq, stored.robot_time_us, stored.utc_us)};
    for (const auto member : kSampleMembers) fields.push_back(bits(stored.sample.*member));
    fields.push_back(fmt::format("{} {}", protocol::text(stored.mode), protocol::text(stored.sub_state)));
    fields.push_back(bits(stored.setpoint_m.value_or(NAN)));
    fields.push_back(bits(stored.disturbance_m));
    fields.push_back(fmt::format("{} {}", stored.clock_uncertainty_us, stored.received_at_us));
    fields.push_back(bits(stored.position_sd_m));
    fields.push_back(fmt::format("{} {} {} {}", stored.controller_id, stored.emergency_id, stored.flags, gap_before));
    return joined(fields);
  }

  Lines csv_lines(RunId run) {
    std::istringstream in{csv({.run = run, .channels = all_channels(), .grid_us = {}})};
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line,
              "span,boot_id,seq,robot_time_us,utc,position_m,velocity_m_s,acceleration_m_s2,duty,impedance_mv,"
              "reference_m,mode,sub_state,setpoint_m,disturbance_m,clock_uncertainty_us,received_at_us,position_sd_m,"
              "controller_id,emergency_id,flags,gap_before");
    Lines lines;
    while (std::getline(in, line)) {
      std::vector<std::string> fields = split(line, ',');
      EXPECT_EQ(fields.size(), 22u) << line;
      fields.at(4) = std::to_string(utc_us_of(fields.at(4)));
      for (const std::size_t column : {5U, 6U, 7U, 8U, 9U, 10U, 13U, 14U, 17U})
        fields.at(column) = bits_of(fields.at(column));
      lines.push_back(joined(fields));
    }
    return lines;
  }

  // "2026-03-01T12:00:00.000001Z"
  static std::int64_t utc_us_of(const std::string& text) {
    std::tm time{};
    EXPECT_NE(strptime(text.c_str(), "%Y-%m-%dT%H:%M:%S", &time), nullptr) << text;
    EXPECT_EQ(text.size(), 27u) << text;
    return timegm(&time) * 1'000'000 + std::stoll(text.substr(20, 6));
  }

  Lines rows_of(const std::filesystem::path& file, const std::string& table) {
    SQLite::Database database{file.string(), SQLite::OPEN_READONLY};
    SQLite::Statement query{
        database,
        "SELECT span, boot_id, seq, robot_time_us, utc_us, position_m, velocity_m_s, acceleration_m_s2, duty,"
        " impedance_mv, reference_m, mode, sub_state, setpoint_m, disturbance_m, clock_uncertainty_us, received_at_us,"
        " position_sd_m, controller_id, emergency_id, flags FROM " +
            table};
    Lines lines;
    while (query.executeStep()) {
      std::vector<std::string> fields;
      for (int column = 0; column < 21; ++column) {
        const auto value = query.getColumn(column);
        const bool is_float = (column >= 5 && column <= 10) || column == 13 || column == 14 || column == 17;
        const float number = value.isNull() ? NAN : static_cast<float>(value.getDouble());
        fields.push_back(is_float ? bits(number) : value.getString());
      }
      lines.push_back(joined(fields));
    }
    return lines;
  }

  // The variables of a MAT file as matio reads them.
  struct Variable {
    std::vector<double> numbers;
    std::vector<float> singles;
  };
  static std::map<std::string, Variable> variables_of(const std::filesystem::path& path) {
    std::map<std::string, Variable> variables;
    const std::unique_ptr<mat_t, int (*)(mat_t*)> file{Mat_Open(path.c_str(), MAT_ACC_RDONLY), Mat_Close};
    EXPECT_NE(file, nullptr);
    while (matvar_t* read = Mat_VarReadNext(file.get())) {
      const std::unique_ptr<matvar_t, void (*)(matvar_t*)> variable{read, Mat_VarFree};
      Variable& into = variables[variable->name];
      if (variable->class_type == MAT_C_STRUCT) continue;
      EXPECT_EQ(variable->rank, 2);
      EXPECT_EQ(variable->dims[1], 1u);
      for (std::size_t row = 0; row < variable->dims[0]; ++row) {
        if (variable->class_type == MAT_C_DOUBLE) into.numbers.push_back(static_cast<double*>(variable->data)[row]);
        if (variable->class_type == MAT_C_UINT32)
          into.numbers.push_back(static_cast<std::uint32_t*>(variable->data)[row]);
        if (variable->class_type == MAT_C_SINGLE) into.singles.push_back(static_cast<float*>(variable->data)[row]);
      }
    }
    return variables;
  }

  std::filesystem::path mat(const ExportQuery& query) {
    const auto file = folder_ / "run.mat";
    SQLite::Database database = open_for_reading(path_);
    MatWriter writer{file, spans_of(query.run), query};
    while (writer.advance(database).value()) continue;
    return file;
  }

  Lines mat_lines(RunId run) {
    const auto variables = variables_of(mat({.run = run, .channels = all_channels(), .grid_us = {}}));
    const auto spans = spans_of(run);
    const auto number = [&](const char* name, std::size_t row) {
      return static_cast<std::int64_t>(variables.at(name).numbers.at(row));
    };
    const auto single = [&](const char* name, std::size_t row) { return bits(variables.at(name).singles.at(row)); };
    Lines lines;
    for (std::size_t row = 0; row < variables.at("span").numbers.size(); ++row) {
      const auto span = static_cast<std::size_t>(number("span", row));
      const std::uint64_t emergency_id = static_cast<std::uint64_t>(number("emergency_id_high", row)) << 32 |
                                         static_cast<std::uint64_t>(number("emergency_id_low", row));
      std::vector<std::string> fields{fmt::format("{} {} {} {} {}", span, spans.at(span).boot_id, number("seq", row),
                                                  number("robot_time_us", row), number("utc_us", row))};
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        fields.push_back(single(text(static_cast<Channel>(channel)), row));
      }
      fields.emplace_back(protocol::text(static_cast<protocol::Mode>(number("mode", row))));
      fields.emplace_back(protocol::text(static_cast<protocol::SubState>(number("sub_state", row))));
      fields.push_back(single("setpoint_m", row));
      fields.push_back(single("disturbance_m", row));
      fields.push_back(fmt::format("{} {}", number("clock_uncertainty_us", row), number("received_at_us", row)));
      fields.push_back(single("position_sd_m", row));
      fields.push_back(fmt::format("{} {} {} {}", number("controller_id", row), emergency_id, number("flags", row),
                                   number("gap_before", row)));
      lines.push_back(joined(fields));
    }
    return lines;
  }

  std::filesystem::path run_file(RunId run) {
    const auto file = folder_ / "run.sqlite";
    std::filesystem::remove(file);
    SQLite::Database database = open_for_reading(path_);
    RunFile writer{
        file, reading_uri(path_, false), spans_of(run), {.run = run, .channels = all_channels(), .grid_us = {}}};
    while (writer.advance(database)) continue;
    return file;
  }

  Lines json_lines(RunId run) {
    const SegmentPage page = wait(history_->segments(excerpt_of(run), {}, kMaxPageSamples)).value();
    Lines lines;
    const auto json = nlohmann::json::parse(page_text(page));
    const auto number = [](const nlohmann::json& value) { return value.is_null() ? NAN : value.get<float>(); };
    const auto word = [](const nlohmann::json& value) {
      return value.is_null() ? "0" : value.is_string() ? value.get<std::string>() : value.dump();
    };
    for (const auto& sample : json["samples"]) {
      std::vector<std::string> fields;
      for (const char* name : {"span", "boot_id", "seq", "robot_time_us", "utc_us"})
        fields.push_back(word(sample[name]));
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        fields.push_back(bits(number(sample[text(static_cast<Channel>(channel))])));
      }
      for (const char* name : {"mode", "sub_state"}) fields.push_back(word(sample[name]));
      for (const char* name : {"setpoint_m", "disturbance_m"}) fields.push_back(bits(number(sample[name])));
      for (const char* name : {"clock_uncertainty_us", "received_at_us"}) fields.push_back(word(sample[name]));
      fields.push_back(bits(number(sample["position_sd_m"])));
      for (const char* name : {"controller_id", "emergency_id", "flags"}) fields.push_back(word(sample[name]));
      lines.push_back(joined(fields));
    }
    EXPECT_EQ(json["next"], nullptr);
    return lines;
  }
};

// Without the last field, gap_before, which only exports have.
Lines without_gap(Lines lines) {
  for (std::string& line : lines) line.resize(line.rfind(' '));
  return lines;
}

TEST_F(ExportTest, WhatIsExportedIsWhatTheApiSaysAndWhatIsStored) {
  for (const unsigned seed : {21U, 22U}) {
    SCOPED_TRACE(seed);
    const RunId run = record(seed);
    const Lines expected = api_lines(run);
    ASSERT_GT(expected.size(), 500u);
    for (const bool stored : {false, true}) {
      SCOPED_TRACE(stored);
      if (stored) flush();
      EXPECT_EQ(json_lines(run), without_gap(expected));
      EXPECT_EQ(csv_lines(run), expected);
      EXPECT_EQ(mat_lines(run), expected);
      const auto file = run_file(run);
      EXPECT_EQ(rows_of(file, "sample ORDER BY rowid"), without_gap(expected));
    }
    EXPECT_EQ(rows_of(path_, "run_sample WHERE run_id = 1"), without_gap(expected));
    kill();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    robot_ = TestRobot{};
  }
}

TEST_F(ExportTest, ARunFileHoldsTheRunsOtherRowsAndIsNoStationsDatabase) {
  const RunId run = record(23);
  wait(runs_->end(run, ""));
  EXPECT_TRUE(wait(runs_->create(robot_.id, named("other"))).has_value());
  const auto file = run_file(run);
  SQLite::Database database{file.string(), SQLite::OPEN_READONLY};
  const auto value = [&](const char* sql) { return database.execAndGet(sql).getString(); };
  EXPECT_EQ(value("PRAGMA application_id"), std::to_string(kApplicationId + 1));
  EXPECT_EQ(value("PRAGMA integrity_check"), "ok");
  EXPECT_EQ(value("SELECT group_concat(name) FROM run"), "everything");
  EXPECT_EQ(value("SELECT count(*) FROM span"), "2");
  EXPECT_EQ(value("SELECT sum(last_seq - first_seq + 1) FROM gap"),
            rows("SELECT sum(last_seq - first_seq + 1) FROM run_gap").at(0));
  EXPECT_FALSE(std::filesystem::exists(file.string() + "-wal"));
  kill();
  EXPECT_THROW(Database{file}, std::exception);
}

TEST_F(ExportTest, ARunFileHasTheEventsOfItsSamplesWheneverTheyCame) {
  start();
  connect(robot_);
  make(robot_, 50);
  const RunId run = wait(runs_->create(robot_.id, named("with events")))->id;
  make(robot_, 100);
  wait(runs_->end(run, ""));
  clock_.run_for(5s);
  std::uint64_t event_seq = 0;
  for (const std::uint64_t sample_seq : {49u, 50u, 149u, 150u}) {
    RobotEvent event;
    event.robot_id = robot_.id;
    event.boot_id = robot_.boot_id;
    event.event_seq = event_seq++;
    event.sample_seq = sample_seq;
    event.kind = "detection";
    event.received_at_us = clock_.utc_us();
    recorder_->on_event(RobotState{}, event);
  }
  wait(recorder_->flush_records());
  SQLite::Database database{run_file(run).string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(database.execAndGet("SELECT group_concat(sample_seq) FROM event").getString(), "50,149");
}

TEST_F(ExportTest, AGridAndChosenChannelsAreTheSameInCsvAndMat) {
  const RunId run = record(24);
  const ExportQuery query{.run = run, .channels = parse_channels("velocity_m_s,duty").value(), .grid_us = 25'000};
  const auto variables = variables_of(mat(query));
  std::istringstream in{csv(query)};
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "span,t_s,utc,velocity_m_s,duty,setpoint_m,gap");
  std::size_t row = 0;
  int gaps = 0;
  for (; std::getline(in, line); ++row) {
    const std::vector<std::string> fields = split(line, ',');
    ASSERT_EQ(fields.size(), 7u);
    EXPECT_EQ(std::stod(fields[0]), variables.at("span").numbers.at(row));
    EXPECT_NEAR(std::stod(fields[1]), variables.at("t_s").numbers.at(row), 1e-9);
    EXPECT_EQ(utc_us_of(fields[2]), static_cast<std::int64_t>(variables.at("utc_us").numbers.at(row)));
    EXPECT_EQ(bits_of(fields[3]), bits(variables.at("velocity_m_s").singles.at(row)));
    EXPECT_EQ(bits_of(fields[4]), bits(variables.at("duty").singles.at(row)));
    EXPECT_EQ(bits_of(fields[5]), bits(variables.at("setpoint_m").singles.at(row)));
    EXPECT_EQ(std::stod(fields[6]), variables.at("gap").numbers.at(row));
    gaps += fields[6] == "1";
  }
  EXPECT_EQ(row, variables.at("gap").numbers.size());
  EXPECT_GT(gaps, 0);
  EXPECT_FALSE(variables.contains("position_m"));
}

TEST_F(ExportTest, AMatFileSaysWhatIsKnownOfTheRun) {
  const RunId run = record(25);
  const auto file = mat({.run = run, .channels = all_channels(), .grid_us = {}});
  const std::unique_ptr<mat_t, int (*)(mat_t*)> opened{Mat_Open(file.c_str(), MAT_ACC_RDONLY), Mat_Close};
  const std::unique_ptr<matvar_t, void (*)(matvar_t*)> facts{Mat_VarRead(opened.get(), "info"), Mat_VarFree};
  ASSERT_NE(facts, nullptr);
  const auto field = [&](const char* name) {
    const matvar_t* found = Mat_VarGetStructFieldByName(facts.get(), name, 0);
    if (found == nullptr || found->data == nullptr) return std::string{};
    const std::u16string wide{static_cast<const char16_t*>(found->data), found->nbytes / 2};
    return std::string{wide.begin(), wide.end()};
  };
  EXPECT_EQ(field("name"), "everything");
  EXPECT_EQ(field("robot_id"), robot_.id);
  EXPECT_EQ(field("boot_ids"), fmt::format("0 {}, 1 {}", robot_.boot_id - 1, robot_.boot_id));
  EXPECT_NE(field("modes").find(fmt::format("{} auto", static_cast<int>(rheonaut_MODE_AUTO))), std::string::npos);
}

// A gap of an hour on a grid of 0.1 ms is 36 million rows: they come in pieces.
TEST_F(ExportTest, ALongGapOnAFineGridComesInPieces) {
  start();
  connect(robot_);
  const RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  make(robot_, 5);
  robot_.late_us = 3'600'000'000;
  make(robot_, 5);
  SQLite::Database database = open_for_reading(path_);
  CsvWriter writer{spans_of(run), {.run = run, .channels = all_channels(), .grid_us = 100}};
  for (int piece = 0; piece < 20; ++piece) EXPECT_LT(writer.next(database).value().size(), 500'000u);
}

TEST_F(ExportTest, TheCommandWritesWhatTheStationExports) {
  const RunId run = record(26);
  flush();
  const std::string expected = csv({.run = run, .channels = all_channels(), .grid_us = {}});
  for (const bool runs : {true, false}) {
    if (!runs) stop();
    cli::Export wish;
    wish.run = run;
    wish.to = folder_ / "out.csv";
    wish.data_dir = folder_;
    std::ostringstream out;
    EXPECT_EQ(cli::run(wish, out), 0);
    std::ifstream in{wish.to};
    const std::string written{std::istreambuf_iterator<char>{in}, {}};
    EXPECT_EQ(written.size(), expected.size());
    EXPECT_TRUE(written == expected);
    wish.format = cli::ExportFormat::sqlite;
    wish.to = folder_ / "out.sqlite";
    EXPECT_EQ(cli::run(wish, out), 0);
    EXPECT_EQ(rows_of(wish.to, "sample").size(), rows_of(path_, "run_sample").size());
    wish.format = cli::ExportFormat::mat;
    wish.to = folder_ / "out.mat";
    EXPECT_EQ(cli::run(wish, out), 0);
    EXPECT_EQ(variables_of(wish.to).at("seq").numbers.size(), rows_of(path_, "run_sample").size());
    wish.run = 99;
    wish.to = folder_ / "none.mat";
    EXPECT_THROW(cli::run(wish, out), std::runtime_error);
    EXPECT_FALSE(std::filesystem::exists(wish.to));
    EXPECT_FALSE(std::filesystem::exists(wish.to.string() + ".part"));
  }
}

}  // namespace
}  // namespace server
