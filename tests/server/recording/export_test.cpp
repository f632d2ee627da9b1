// One recording, and the same numbers wherever it is read: in the database, by the API, as CSV, MAT and SQLite.
#include "tests/server/recording/export_reading.hpp"

#include <algorithm>
#include <fstream>

#include "server/cli/data/export.hpp"
#include "server/storage/database/schema.hpp"

namespace server {
namespace {

TEST_F(ExportTest, WhatIsExportedIsWhatTheApiSaysAndWhatIsStored) {
  for (const unsigned seed : {21U, 22U}) {
    SCOPED_TRACE(seed);
    const storage::RunId run = record(seed);
    for (const bool stored : {false, true}) {
      SCOPED_TRACE(stored);
      if (stored) flush();
      const Lines expected = api_lines(run);  // when the last segment had arrived is known once it is stored
      ASSERT_GT(expected.size(), 500u);
      EXPECT_EQ(json_lines(run), without_gaps(expected));
      EXPECT_EQ(csv_lines(run), expected);
      EXPECT_EQ(mat_lines(run), expected);
      const auto file = run_file(run);
      EXPECT_EQ(rows_of(file, "sample ORDER BY rowid"), without_gaps(expected));
      EXPECT_EQ(gaps_in(file), gaps_of(expected));
    }
    EXPECT_EQ(rows_of(path_, "run_sample WHERE run_id = 1"), without_gaps(api_lines(run)));
    kill();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    robot_ = TestRobot{};
  }
}

TEST_F(ExportTest, ARunFileHoldsTheRunsOtherRowsAndIsNoStationsDatabase) {
  const storage::RunId run = record(23);
  wait(runs_->end(run, ""));
  EXPECT_TRUE(wait(runs_->create(robot_.id, named("other"))).has_value());
  const auto file = run_file(run);
  SQLite::Database database{file.string(), SQLite::OPEN_READONLY};
  const auto value = [&](const char* sql) { return database.execAndGet(sql).getString(); };
  EXPECT_EQ(value("PRAGMA application_id"), std::to_string(storage::kApplicationId + 1));
  EXPECT_EQ(value("PRAGMA integrity_check"), "ok");
  EXPECT_EQ(value("SELECT group_concat(name) FROM run"), "everything");
  EXPECT_EQ(value("SELECT count(*) FROM span"), "2");
  EXPECT_EQ(value("SELECT sum(last_seq - first_seq + 1) FROM gap"),
            rows("SELECT sum(last_seq - first_seq + 1) FROM run_gap").at(0));
  EXPECT_EQ(value("SELECT group_concat(name) FROM sqlite_schema WHERE type IN ('table', 'view') AND name NOT IN"
                  " (SELECT name FROM about WHERE column_name IS NULL AND meaning <> '')"),
            "");
  EXPECT_EQ(value("SELECT group_concat(made.name || '.' || field.name) FROM sqlite_schema AS made,"
                  " pragma_table_info(made.name) AS field WHERE made.type IN ('table', 'view') AND NOT EXISTS"
                  " (SELECT 1 FROM about WHERE about.name = made.name AND column_name = field.name AND meaning <> '')"),
            "")
      << "give each a row in run_file_about.cpp";
  EXPECT_EQ(value("SELECT group_concat(name) FROM about WHERE name NOT IN (SELECT name FROM sqlite_schema)"), "");
  EXPECT_FALSE(std::filesystem::exists(file.string() + "-wal"));
  kill();
  EXPECT_THROW(storage::Database{file}, std::exception);
}

// What was lost at the end of a span is counted in its last row, is on the grid, and is what /gaps lists.
TEST_F(ExportTest, LossesAtTheEndOfASpanShowInEveryFormat) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  make(robot_, 100);
  robot_.next_seq += 30;  // their frames are lost, and the reboot takes them
  disconnect(robot_);
  connect(robot_);
  robot_.boot_id += 1;
  robot_.next_seq = 0;
  connect(robot_);
  make(robot_, 50);
  for (const bool stored : {false, true}) {
    SCOPED_TRACE(stored);
    if (stored) flush();
    const std::vector<storage::Gap> gaps = wait(history_->gaps(storage::excerpt_of(run))).value().gaps;
    ASSERT_EQ(gaps.size(), 1u);
    EXPECT_EQ(gaps[0].first_seq, 100u);
    EXPECT_EQ(gaps[0].last_seq, 129u);
    for (const Lines& lines : {csv_lines(run), mat_lines(run)}) {
      ASSERT_EQ(lines.size(), 150u);
      EXPECT_TRUE(lines[98].ends_with(" 0 0"));
      EXPECT_TRUE(lines[99].ends_with(" 0 30")) << lines[99];
      EXPECT_TRUE(lines[149].ends_with(" 0 0")) << lines[149];
    }
    EXPECT_EQ(gaps_in(run_file(run)).at(99), "0 0 30");
    std::istringstream grid{csv({.run = run, .channels = storage::all_channels(), .grid_us = 10'000})};
    Lines rows;
    for (std::string line; std::getline(grid, line);) rows.push_back(line);
    ASSERT_EQ(rows.size(), 1u + 130 + 50);
    EXPECT_TRUE(rows[100].starts_with("0,0.990000,") && rows[100].ends_with(",0")) << rows[100];
    EXPECT_TRUE(rows[101].starts_with("0,1.000000,") && rows[101].ends_with(",1")) << rows[101];
    EXPECT_TRUE(rows[130].starts_with("0,1.290000,") && rows[130].ends_with(",1")) << rows[130];
    EXPECT_TRUE(rows[131].starts_with("1,0.000000,") && rows[131].ends_with(",0")) << rows[131];
  }
}

TEST_F(ExportTest, ARunFileHasTheEventsOfItsSamplesWheneverTheyCame) {
  start();
  connect(robot_);
  make(robot_, 50);
  const storage::RunId run = wait(runs_->create(robot_.id, named("with events")))->id;
  make(robot_, 100);
  wait(runs_->end(run, ""));
  clock_.run_for(5s);
  std::uint64_t event_seq = 0;
  for (const std::uint64_t sample_seq : {49u, 50u, 149u, 150u}) {
    station::RobotEvent event;
    event.robot_id = robot_.id;
    event.boot_id = robot_.boot_id;
    event.event_seq = event_seq++;
    event.sample_seq = sample_seq;
    event.kind = "detection";
    event.received_at_us = clock_.utc_us();
    recorder_->on_event(station::RobotState{}, event);
  }
  wait(recorder_->flush_records());
  SQLite::Database database{run_file(run).string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(database.execAndGet("SELECT group_concat(sample_seq) FROM event").getString(), "50,149");
}

// Other exports wait for a slice, not for all of a robot's events and commands.
TEST_F(ExportTest, TablesOfAnyLengthAreCopiedInSlices) {
  constexpr int kEvents = 2'500;
  constexpr int kCommands = 2'300;
  start();
  connect(robot_);
  make(robot_, 10);
  station::CommandRecord command;
  command.robot_id = robot_.id;
  command.kind = "ping";
  command.arguments = "{}";
  command.id = 1;
  command.submitted_at_us = clock_.utc_us() - 1;
  recorder_->on_command(command);  // before the run
  const storage::RunId run = wait(runs_->create(robot_.id, named("busy")))->id;
  make(robot_, 10);
  station::RobotEvent event;
  event.robot_id = robot_.id;
  event.kind = "connected";
  for (int n = 0; n < kEvents; ++n) {
    event.received_at_us = clock_.utc_us() + n;
    recorder_->on_event(station::RobotState{}, event);
  }
  for (int n = 0; n < kCommands; ++n) {
    command.id += 1;
    command.submitted_at_us = clock_.utc_us() + n / 2;  // two at a time
    recorder_->on_command(command);
  }
  flush();
  wait(recorder_->flush_records());
  const auto file = folder_ / "run.sqlite";
  {
    SQLite::Database database = storage::open_for_reading(path_);
    storage::RunFile writer{file,
                            storage::reading_uri(path_, false),
                            spans_of(run),
                            {.run = run, .channels = storage::all_channels(), .grid_us = {}}};
    std::int64_t most = 0;
    std::int64_t before = 0;
    for (bool more = writer.advance(database); more; more = writer.advance(database)) {
      SQLite::Database made{file.string(), SQLite::OPEN_READONLY};
      std::int64_t copied = 0;
      for (const char* table : {"event", "command"}) {
        if (made.tableExists(table)) copied += made.execAndGet(std::string{"SELECT count(*) FROM "} + table).getInt64();
      }
      most = std::max(most, copied - before);
      before = copied;
    }
    EXPECT_LE(most, 1'001);
  }
  SQLite::Database made{file.string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(made.execAndGet("SELECT count(DISTINCT event_row) FROM event").getInt64(), kEvents);
  EXPECT_EQ(made.execAndGet("SELECT count(DISTINCT command_id) FROM command").getInt64(), kCommands);
  EXPECT_EQ(made.execAndGet("SELECT count(*) FROM command").getInt64(), kCommands);
}

TEST_F(ExportTest, RenewalsThatBeganBeforeTheRunAndWentOnInItAreInItsFile) {
  start();
  connect(robot_);
  make(robot_, 10);
  const auto renew = [this](station::CommandId id) {
    station::CommandRecord renewal;
    renewal.id = id;
    renewal.robot_id = robot_.id;
    renewal.kind = "renew_lease";
    renewal.arguments = "{}";
    renewal.submitted_at_us = clock_.utc_us();
    recorder_->on_command(renewal);
    renewal.state = station::CommandState::acknowledged;
    renewal.ended_at_us = clock_.utc_us();
    recorder_->on_command(renewal);
    clock_.run_for(150ms);
  };
  for (station::CommandId id = 1; id <= 3; ++id) renew(id);
  clock_.run_for(2s);
  for (station::CommandId id = 11; id <= 13; ++id) renew(id);
  const storage::RunId run = wait(runs_->create(robot_.id, named("held")))->id;
  for (station::CommandId id = 14; id <= 16; ++id) renew(id);
  clock_.run_for(2s);
  make(robot_, 10);
  flush();
  wait(recorder_->flush_records());
  SQLite::Database database{run_file(run).string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(database.execAndGet("SELECT group_concat(command_id || ' ' || further_renewals) FROM command").getString(),
            "11 5");
}

TEST_F(ExportTest, AGridAndChosenChannelsAreTheSameInCsvAndMat) {
  const storage::RunId run = record(24);
  const storage::ExportQuery query{
      .run = run, .channels = storage::parse_channels("velocity_m_s,duty").value(), .grid_us = 25'000};
  const auto variables = variables_of(mat(query));
  std::istringstream in{csv(query)};
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "span,t_s,utc,velocity_m_s,duty,setpoint_m,mode,gap");
  std::size_t row = 0;
  int gaps = 0;
  for (; std::getline(in, line); ++row) {
    const std::vector<std::string> fields = split(line, ',');
    ASSERT_EQ(fields.size(), 8u);
    EXPECT_EQ(std::stod(fields[0]), variables.at("span").numbers.at(row));
    EXPECT_NEAR(std::stod(fields[1]), variables.at("t_s").numbers.at(row), 1e-9);
    EXPECT_EQ(utc_us_of(fields[2]), static_cast<std::int64_t>(variables.at("utc_us").numbers.at(row)));
    EXPECT_EQ(bits_of(fields[3]), bits(variables.at("velocity_m_s").singles.at(row)));
    EXPECT_EQ(bits_of(fields[4]), bits(variables.at("duty").singles.at(row)));
    EXPECT_EQ(bits_of(fields[5]), bits(variables.at("setpoint_m").singles.at(row)));
    EXPECT_EQ(fields[6], variables.at("mode_text").texts.at(row));
    EXPECT_EQ(fields[6].empty(), fields[7] == "1");
    EXPECT_EQ(std::stod(fields[7]), variables.at("gap").numbers.at(row));
    gaps += fields[7] == "1";
  }
  EXPECT_EQ(row, variables.at("gap").numbers.size());
  EXPECT_GT(gaps, 0);
  EXPECT_FALSE(variables.contains("position_m"));
}

TEST_F(ExportTest, AMatFileSaysWhatIsKnownOfTheRun) {
  const storage::RunId run = record(25);
  const auto file = mat({.run = run, .channels = storage::all_channels(), .grid_us = {}});
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
  const matvar_t* boots = Mat_VarGetStructFieldByName(facts.get(), "boot_ids", 0);
  ASSERT_TRUE(boots != nullptr && boots->class_type == MAT_C_UINT64 && boots->dims[0] == 2);
  EXPECT_EQ(static_cast<const std::uint64_t*>(boots->data)[0], robot_.boot_id - 1);
  EXPECT_EQ(static_cast<const std::uint64_t*>(boots->data)[1], robot_.boot_id);
  EXPECT_NE(field("modes").find(fmt::format("{} auto", static_cast<int>(rheonaut_MODE_AUTO))), std::string::npos);
}

TEST_F(ExportTest, AMatFileCanBeReadWhateverTheNameOfTheRun) {
  const storage::RunId run = record(2);
  std::string longest;
  for (int i = 0; i < 64; ++i) longest += "🐟";
  for (const auto& [name, read] : {std::pair<std::string, std::u16string>{"µ שלום 語", u"µ שלום 語"},
                                   {"a 🐟 b", u"a \\u{1F41F} b"},
                                   {longest, u""}}) {
    SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
    SQLite::Statement rename{foreign, "UPDATE run SET name = ?"};
    rename.bind(1, name);
    rename.exec();
    const auto file = mat({.run = run, .channels = storage::all_channels(), .grid_us = {}});
    const std::unique_ptr<mat_t, int (*)(mat_t*)> opened{Mat_Open(file.c_str(), MAT_ACC_RDONLY), Mat_Close};
    const std::unique_ptr<matvar_t, void (*)(matvar_t*)> facts{Mat_VarRead(opened.get(), "info"), Mat_VarFree};
    ASSERT_NE(facts, nullptr);
    const matvar_t* found = Mat_VarGetStructFieldByName(facts.get(), "name", 0);
    ASSERT_TRUE(found != nullptr && found->data != nullptr);
    const std::u16string wide{static_cast<const char16_t*>(found->data), found->nbytes / 2};
    EXPECT_EQ(wide.size(), found->dims[1]);
    EXPECT_TRUE(std::ranges::none_of(wide, [](char16_t unit) { return unit >= 0xD800 && unit < 0xE000; })) << name;
    if (!read.empty()) {
      EXPECT_TRUE(wide == read) << name;
    }
  }
}

// A gap of an hour on a grid of 0.1 ms is 36 million rows: they come in pieces.
TEST_F(ExportTest, ALongGapOnAFineGridComesInPieces) {
  start();
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
  make(robot_, 5);
  robot_.late_us = 3'600'000'000;
  make(robot_, 5);
  SQLite::Database database = storage::open_for_reading(path_);
  storage::CsvWriter writer{spans_of(run), {.run = run, .channels = storage::all_channels(), .grid_us = 100}};
  for (int piece = 0; piece < 20; ++piece) EXPECT_LT(writer.next(database).value().size(), 500'000u);
}

TEST_F(ExportTest, TheCommandWritesWhatTheStationExports) {
  const storage::RunId run = record(26);
  flush();
  const std::string expected = csv({.run = run, .channels = storage::all_channels(), .grid_us = {}});
  for (const bool runs : {true, false}) {
    if (!runs) stop();
    cli::Export options;
    options.run = run;
    options.to = folder_ / "out.csv";
    options.data_dir = folder_;
    options.form.is_json = true;
    std::ostringstream out;
    EXPECT_EQ(cli::run(options, out), 0);
    const nlohmann::json said{{"run_id", run},
                              {"format", "csv"},
                              {"file", options.to.string()},
                              {"size_bytes", std::filesystem::file_size(options.to)}};
    EXPECT_EQ(nlohmann::json::parse(out.str()), said);
    std::ifstream in{options.to};
    const std::string written{std::istreambuf_iterator<char>{in}, {}};
    EXPECT_EQ(written.size(), expected.size());
    EXPECT_TRUE(written == expected);
    options.format = cli::ExportFormat::sqlite;
    options.to = folder_ / "out.sqlite";
    EXPECT_EQ(cli::run(options, out), 0);
    EXPECT_EQ(rows_of(options.to, "sample").size(), rows_of(path_, "run_sample").size());
    options.format = cli::ExportFormat::mat;
    options.to = folder_ / "out.mat";
    EXPECT_EQ(cli::run(options, out), 0);
    EXPECT_EQ(variables_of(options.to).at("seq").numbers.size(), rows_of(path_, "run_sample").size());
    options.run = 99;
    options.to = folder_ / "none.mat";
    EXPECT_THROW(cli::run(options, out), std::runtime_error);
    EXPECT_FALSE(std::filesystem::exists(options.to));
    EXPECT_FALSE(std::filesystem::exists(options.to.string() + ".part"));
  }
}

}  // namespace
}  // namespace server
