// Reads exports back: a line per sample, equal wherever the same sample comes from.
#pragma once

#include <fmt/format.h>
#include <matio.h>

#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "server/api/bodies/column_text.hpp"
#include "server/station/state/unknown_values.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/export/csv_writer.hpp"
#include "server/storage/export/mat/mat_writer.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"
#include "tests/server/recording/random_recording.hpp"

namespace server {

// As binary32, so that not a bit is lost; every NaN is the same.
inline std::string bits(float value) {
  return std::isnan(value) ? "none" : fmt::format("{:08x}", std::bit_cast<std::uint32_t>(value));
}
inline std::string bits_of(const std::string& text) {
  return text.empty() ? "none" : bits(std::strtof(text.c_str(), nullptr));
}

using Lines = std::vector<std::string>;  // a sample each: whole numbers and words as text, floats as bits

inline std::vector<std::string> split(const std::string& line, char separator) {
  std::vector<std::string> fields;
  std::istringstream in{line};
  for (std::string field; std::getline(in, field, separator);) fields.push_back(field);
  if (!line.empty() && line.back() == separator) fields.emplace_back();
  return fields;
}

inline std::string joined(const std::vector<std::string>& fields) { return fmt::format("{}", fmt::join(fields, " ")); }

// t_s of rows is the time since the first row of its span, to the last bit.
class SpanTimes {
 public:
  void expect(std::uint32_t span, std::int64_t robot_time_us, double t_s) {
    const std::int64_t begin_us = begin_us_.try_emplace(span, robot_time_us).first->second;
    EXPECT_EQ(t_s, static_cast<double>(robot_time_us - begin_us) / 1e6) << "span " << span << ", " << robot_time_us;
  }

 private:
  std::map<std::uint32_t, std::int64_t> begin_us_;
};

class ExportTest : public RandomRecordingTest {
 protected:
  std::vector<storage::RecordedSpan> spans_of(storage::RunId run) {
    auto spans = wait(recording_->exports.spans(storage::excerpt_of(run))).value();
    for (storage::RecordedSpan& span : spans) span.cut(span.made());
    return spans;
  }

  std::string csv(const storage::ExportQuery& query) {
    SQLite::Database database = storage::open_for_reading(path_);
    storage::CsvWriter writer{spans_of(query.run), query};
    std::string text;
    while (const auto piece = writer.next(database)) text += *piece;
    return text;
  }

  // By the history of the readers, with what waits.
  Lines api_lines(storage::RunId run) {
    Lines lines;
    std::optional<storage::StoredSample> last;
    const auto spans = spans_of(run);
    for (const storage::StoredSample& stored : samples_of(run)) {
      const bool follows = last && last->span == stored.span;
      const std::uint64_t expected = follows ? last->seq + 1 : spans.at(stored.span).samples.first;
      if (last && !follows) lines.back() += after_text(spans.at(last->span), *last);
      if (follows) lines.back() += " 0";
      lines.push_back(line_of(stored, follows ? missed_between(*last, stored) : 0, stored.seq - expected));
      last = stored;
    }
    if (last) lines.back() += after_text(spans.at(last->span), *last);
    return lines;
  }
  static std::string after_text(const storage::RecordedSpan& span, const storage::StoredSample& last) {
    return fmt::format(" {}", span.made().next - last.seq - 1);
  }

  // Ticks without a sample between two samples of one span, by the longer period of both.
  static std::uint64_t missed_between(const storage::StoredSample& before, const storage::StoredSample& after) {
    const double period_us = std::max(before.period_us, after.period_us);
    const auto us = static_cast<double>(after.robot_time_us - before.robot_time_us);
    return static_cast<std::uint64_t>(
        std::max(0.0, std::round(us / period_us) - static_cast<double>(after.seq - before.seq)));
  }

  // Without gap_after.
  static std::string line_of(const storage::StoredSample& stored, std::uint64_t missed, std::uint64_t gap_before) {
    std::vector<std::string> fields{
        fmt::format("{} {} {} {} {}", stored.span, stored.boot_id, stored.seq, stored.robot_time_us, stored.utc_us)};
    for (const auto member : storage::kSampleMembers) fields.push_back(bits(stored.sample.*member));
    fields.push_back(fmt::format("{} {}", protocol::text(stored.mode), protocol::text(stored.sub_state)));
    fields.push_back(bits(stored.setpoint_m.value_or(NAN)));
    fields.push_back(bits(station::or_nan(stored.disturbance_m)));
    fields.push_back(
        fmt::format("{} {} {}", stored.clock_uncertainty_us, stored.first_received_at_us, stored.received_at_us));
    fields.push_back(bits(station::or_nan(stored.position_sd_m)));
    fields.push_back(fmt::format("{} {} {} {} {} {} {}", stored.controller_id, stored.emergency_id,
                                 protocol::text(stored.emergency_cause), stored.flags,
                                 unknown_values(stored).value_or("none"), missed, gap_before));
    return joined(fields);
  }

  Lines csv_lines(storage::RunId run) {
    std::istringstream in{csv({.run = run, .channels = storage::all_channels(), .grid_us = {}})};
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line,
              "span,boot_id,seq,robot_time_us,t_s,utc,position_m,velocity_m_s,acceleration_m_s2,duty,impedance_mv,"
              "reference_m,mode,sub_state,setpoint_m,disturbance_m,clock_uncertainty_us,first_received_at_us,"
              "received_at_us,position_sd_m,controller_id,emergency_id,emergency_cause,flags,gap_before,gap_after,"
              "unknown_values,missed_ticks_before");
    Lines lines;
    SpanTimes times;
    while (std::getline(in, line)) {
      const std::string missed = line.substr(line.rfind(',') + 1);
      line.resize(line.rfind(','));
      const std::size_t end = line.find(",\"{") != std::string::npos ? line.find(",\"{") : line.size() - 1;
      std::string unknown = line.substr(end + 1);  // {""mode"":17} in quotation marks, or nothing
      if (!unknown.empty()) unknown = unknown.substr(1, unknown.size() - 2);
      for (std::size_t at; (at = unknown.find("\"\"")) != std::string::npos;) unknown.erase(at, 1);
      std::vector<std::string> fields = split(line.substr(0, end), ',');
      EXPECT_EQ(fields.size(), 26u) << line;
      times.expect(static_cast<std::uint32_t>(std::stoul(fields.at(0))), std::stoll(fields.at(3)),
                   std::stod(fields.at(4)));
      fields.erase(fields.begin() + 4);
      fields.at(4) = std::to_string(utc_us_of(fields.at(4)));
      if (fields.at(17).empty()) fields.at(17) = "0";  // not known yet when its segment had arrived
      for (const std::size_t column : {5U, 6U, 7U, 8U, 9U, 10U, 13U, 14U, 18U})
        fields.at(column) = bits_of(fields.at(column));
      fields.insert(fields.end() - 2, {unknown.empty() ? "none" : unknown, missed});
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
        " impedance_mv, reference_m, mode, sub_state, setpoint_m, disturbance_m, clock_uncertainty_us,"
        " first_received_at_us, received_at_us, position_sd_m, controller_id, emergency_id, emergency_cause, flags,"
        " coalesce(unknown_values, 'none') FROM " +
            table};
    Lines lines;
    while (query.executeStep()) {
      std::vector<std::string> fields;
      for (int column = 0; column < 24; ++column) {
        const auto value = query.getColumn(column);
        const bool is_float = (column >= 5 && column <= 10) || column == 13 || column == 14 || column == 18;
        const float number = value.isNull() ? NAN : static_cast<float>(value.getDouble());
        fields.push_back(is_float ? bits(number) : value.getString());
      }
      lines.push_back(joined(fields));
    }
    return lines;
  }

  static Lines gaps_in(const std::filesystem::path& file) {
    SQLite::Database database{file.string(), SQLite::OPEN_READONLY};
    SQLite::Statement query{
        database,
        "SELECT missed_ticks_before || ' ' || gap_before || ' ' || gap_after, span, robot_time_us, t_s FROM sample"
        " ORDER BY rowid"};
    Lines lines;
    SpanTimes times;
    while (query.executeStep()) {
      lines.push_back(query.getColumn(0).getString());
      times.expect(query.getColumn(1).getUInt(), query.getColumn(2).getInt64(), query.getColumn(3).getDouble());
    }
    return lines;
  }

  // The variables of a MAT file as matio reads them.
  struct Variable {
    std::vector<double> numbers;
    std::vector<float> singles;
    std::vector<std::uint64_t> ids;
    std::vector<std::string> texts;  // without the blanks at the end
  };
  static std::string row_of_text(const matvar_t& text, std::size_t row) {
    std::string out;
    for (std::size_t place = 0; place < text.dims[1]; ++place) {
      out +=
          static_cast<const char*>(text.data)[(place * text.dims[0] + row) * static_cast<std::size_t>(text.data_size)];
    }
    return out.substr(0, out.find_last_not_of(' ') + 1);
  }
  static std::map<std::string, Variable> variables_of(const std::filesystem::path& path) {
    std::map<std::string, Variable> variables;
    const std::unique_ptr<mat_t, int (*)(mat_t*)> file{Mat_Open(path.c_str(), MAT_ACC_RDONLY), Mat_Close};
    EXPECT_NE(file, nullptr);
    while (matvar_t* read = Mat_VarReadNext(file.get())) {
      const std::unique_ptr<matvar_t, void (*)(matvar_t*)> variable{read, Mat_VarFree};
      Variable& into = variables[variable->name];
      if (variable->class_type == MAT_C_STRUCT) continue;
      EXPECT_EQ(variable->rank, 2);
      if (variable->class_type != MAT_C_CHAR) EXPECT_EQ(variable->dims[1], 1u);
      for (std::size_t row = 0; row < variable->dims[0]; ++row) {
        if (variable->class_type == MAT_C_DOUBLE) into.numbers.push_back(static_cast<double*>(variable->data)[row]);
        if (variable->class_type == MAT_C_UINT32)
          into.numbers.push_back(static_cast<std::uint32_t*>(variable->data)[row]);
        if (variable->class_type == MAT_C_SINGLE) into.singles.push_back(static_cast<float*>(variable->data)[row]);
        if (variable->class_type == MAT_C_UINT64) into.ids.push_back(static_cast<std::uint64_t*>(variable->data)[row]);
        if (variable->class_type == MAT_C_CHAR) into.texts.push_back(row_of_text(*variable, row));
      }
    }
    return variables;
  }

  std::filesystem::path mat(const storage::ExportQuery& query) {
    const auto file = folder_ / "run.mat";
    SQLite::Database database = storage::open_for_reading(path_);
    storage::MatWriter writer{file, spans_of(query.run), query};
    while (writer.advance(database).value()) continue;
    return file;
  }

  Lines mat_lines(storage::RunId run) {
    const auto variables = variables_of(mat({.run = run, .channels = storage::all_channels(), .grid_us = {}}));
    const auto number = [&](const char* name, std::size_t row) {
      return static_cast<std::int64_t>(variables.at(name).numbers.at(row));
    };
    const auto single = [&](const char* name, std::size_t row) { return bits(variables.at(name).singles.at(row)); };
    const auto id = [&](const char* name, std::size_t row) { return variables.at(name).ids.at(row); };
    const auto text_of = [&](const char* name, std::size_t row) { return variables.at(name).texts.at(row); };
    Lines lines;
    SpanTimes times;
    for (std::size_t row = 0; row < variables.at("span").numbers.size(); ++row) {
      times.expect(static_cast<std::uint32_t>(number("span", row)), number("robot_time_us", row),
                   variables.at("t_s").numbers.at(row));
      std::vector<std::string> fields{fmt::format("{} {} {} {} {}", number("span", row), id("boot_id", row),
                                                  number("seq", row), number("robot_time_us", row),
                                                  number("utc_us", row))};
      for (std::size_t channel = 0; channel < storage::kChannels; ++channel) {
        fields.push_back(single(text(static_cast<storage::Channel>(channel)), row));
      }
      fields.push_back(text_of("mode_text", row));
      fields.push_back(text_of("sub_state_text", row));
      fields.push_back(single("setpoint_m", row));
      fields.push_back(single("disturbance_m", row));
      fields.push_back(fmt::format("{} {} {}", number("clock_uncertainty_us", row), number("first_received_at_us", row),
                                   number("received_at_us", row)));
      fields.push_back(single("position_sd_m", row));
      const auto cause = static_cast<protocol::EmergencyCause>(number("emergency_cause", row));
      const auto unknown = station::UnknownValues{}
                               .add("mode", static_cast<protocol::Mode>(number("mode", row)))
                               .add("sub_state", static_cast<protocol::SubState>(number("sub_state", row)))
                               .add("emergency_cause", cause)
                               .text();
      fields.push_back(fmt::format("{} {} {} {} {} {} {} {}", number("controller_id", row), id("emergency_id", row),
                                   text_of("emergency_cause_text", row), number("flags", row), unknown.value_or("none"),
                                   number("missed_ticks_before", row), number("gap_before", row),
                                   number("gap_after", row)));
      lines.push_back(joined(fields));
    }
    return lines;
  }

  std::filesystem::path run_file(storage::RunId run) {
    const auto file = folder_ / "run.sqlite";
    std::filesystem::remove(file);
    SQLite::Database database = storage::open_for_reading(path_);
    storage::RunFile writer{file,
                            storage::reading_uri(path_, false),
                            spans_of(run),
                            {.run = run, .channels = storage::all_channels(), .grid_us = {}}};
    while (writer.advance(database)) continue;
    return file;
  }

  static std::string in_order(const nlohmann::json& unknown) {
    std::string text;
    for (const char* field : {"mode", "sub_state", "emergency_cause"}) {
      if (unknown.contains(field)) {
        text += fmt::format("{}\"{}\":{}", text.empty() ? '{' : ',', field, unknown[field].get<std::int32_t>());
      }
    }
    return text + '}';
  }

  Lines json_lines(storage::RunId run) {
    const storage::SegmentPage page =
        wait(history_->segments(storage::excerpt_of(run), {}, storage::kMaxPageSamples)).value();
    Lines lines;
    const auto json = nlohmann::json::parse(api::page_text(page));
    const auto number = [](const nlohmann::json& value) { return value.is_null() ? NAN : value.get<float>(); };
    const auto word = [](const nlohmann::json& value) {
      return value.is_null() ? "0" : value.is_string() ? value.get<std::string>() : value.dump();
    };
    for (const auto& sample : json["samples"]) {
      std::vector<std::string> fields;
      for (const char* name : {"span", "boot_id", "seq", "robot_time_us", "utc_us"})
        fields.push_back(word(sample[name]));
      for (std::size_t channel = 0; channel < storage::kChannels; ++channel) {
        fields.push_back(bits(number(sample[text(static_cast<storage::Channel>(channel))])));
      }
      for (const char* name : {"mode", "sub_state"}) fields.push_back(word(sample[name]));
      for (const char* name : {"setpoint_m", "disturbance_m"}) fields.push_back(bits(number(sample[name])));
      for (const char* name : {"clock_uncertainty_us", "first_received_at_us", "received_at_us"})
        fields.push_back(word(sample[name]));
      fields.push_back(bits(number(sample["position_sd_m"])));
      for (const char* name : {"controller_id", "emergency_id", "emergency_cause", "flags"})
        fields.push_back(word(sample[name]));
      const nlohmann::json& unknown = sample["unknown_values"];
      fields.push_back(unknown.is_null() ? "none" : in_order(unknown));
      lines.push_back(joined(fields));
    }
    EXPECT_EQ(json["next"], nullptr);
    return lines;
  }
};

// Without the last fields, missed_ticks_before, gap_before and gap_after, which only exports have.
inline Lines without_gaps(Lines lines) {
  for (std::string& line : lines) {
    for (int field = 0; field < 3; ++field) line.resize(line.rfind(' '));
  }
  return lines;
}

inline Lines gaps_of(const Lines& lines) {
  Lines gaps;
  for (const std::string& line : lines) {
    const std::size_t gaps_at = line.rfind(' ', line.rfind(' ') - 1);
    gaps.push_back(line.substr(line.rfind(' ', gaps_at - 1) + 1));
  }
  return gaps;
}

}  // namespace server
