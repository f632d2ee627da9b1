// matio writes `info`; the columns are appended to its file.
#include "server/storage/export/mat/mat_writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <matio.h>
#include <unistd.h>

#include <algorithm>
#include <boost/locale/encoding_utf.hpp>
#include <cerrno>
#include <limits>
#include <memory>
#include <system_error>
#include <tuple>

#include "server/storage/export/run_facts.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kMatPageSamples = 10'000;
constexpr std::size_t kMaxGridRows = 50'000;  // at a time; a gap may be long
constexpr std::uint64_t kMaxColumnBytes = (std::uint64_t{1} << 31) - 1024;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr auto& kGridMode = std::get<station::BatchField<protocol::Mode>>(station::kBatchFields);

// Of the text of an enumerator; every number that this version does not know has the last word.
template <class Enumerator>
std::uint32_t word_number(Enumerator value) {
  return std::min(static_cast<std::uint32_t>(value), MatColumn::kNoWord - 1);
}

// Numbers first, then the rest; an enumerator once for its numbers and once for its texts.
template <class Put>
void put_context(const station::SampleContext& context, const Put& put) {
  station::for_each_batch_field_of<station::FieldKind::number>(
      [&](const auto& field) { put(station::or_nan(context.*field.member)); });
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    const Value& value = context.*field.member;
    if constexpr (station::BatchField<Value>::kKind == station::FieldKind::enumerator) {
      put(static_cast<std::uint32_t>(value));
      put(word_number(value));
    } else if constexpr (station::BatchField<Value>::kKind != station::FieldKind::number) {
      put(value);
    }
  });
}

// A character is two bytes there. One beyond U+FFFF would be two characters, which readers count as one: to them the
// whole file is broken. So its number is written: \u{1F41F}.
matvar_t* text_variable(const std::string& text) {
  std::u16string wide;
  for (const char32_t character : boost::locale::conv::utf_to_utf<char32_t>(text)) {
    if (character <= 0xFFFF) {
      wide += static_cast<char16_t>(character);
    } else {
      const std::string number = fmt::format("\\u{{{:X}}}", static_cast<std::uint32_t>(character));
      wide.append(number.begin(), number.end());
    }
  }
  std::size_t dimensions[2] = {wide.empty() ? 0U : 1U, wide.size()};
  return Mat_VarCreate(nullptr, MAT_C_CHAR, MAT_T_UTF16, 2, dimensions, wide.data(), 0);
}

matvar_t* number_variable(std::vector<std::uint64_t> numbers) {
  std::size_t dimensions[2] = {numbers.size(), 1};
  return Mat_VarCreate(nullptr, MAT_C_UINT64, MAT_T_UINT64, 2, dimensions, numbers.data(), 0);
}

// Those of an enumerator, and what stands for the others.
template <class Enumerator>
std::vector<std::string> words_of() {
  std::vector<std::string> words = enumerator_texts<Enumerator>();
  words.emplace_back(protocol::text(static_cast<Enumerator>(words.size())));
  return words;
}

[[noreturn]] void fail_with(const std::filesystem::path& path) {
  throw std::system_error{errno == 0 ? EIO : errno, std::generic_category(), "cannot write " + path.string()};
}

void write_struct(const std::filesystem::path& path, const Facts& facts, const std::vector<std::uint64_t>& boot_ids) {
  const std::unique_ptr<mat_t, int (*)(mat_t*)> file{Mat_CreateVer(path.c_str(), nullptr, MAT_FT_MAT5), Mat_Close};
  if (!file) fail_with(path);
  std::vector<const char*> fields;
  for (const auto& [name, value] : facts) fields.push_back(name.c_str());
  fields.push_back("boot_ids");
  std::size_t dimensions[2] = {1, 1};
  const std::unique_ptr<matvar_t, void (*)(matvar_t*)> info{
      Mat_VarCreateStruct("info", 2, dimensions, fields.data(), static_cast<unsigned>(fields.size())), Mat_VarFree};
  if (!info) fail_with(path);
  for (const auto& [name, value] : facts) {
    Mat_VarSetStructFieldByName(info.get(), name.c_str(), 0, text_variable(value));
  }
  Mat_VarSetStructFieldByName(info.get(), "boot_ids", 0, number_variable(boot_ids));
  if (Mat_VarWrite(file.get(), info.get(), MAT_COMPRESSION_NONE) != 0) fail_with(path);
}

}  // namespace

MatWriter::MatWriter(std::filesystem::path path, std::vector<RecordedSpan> spans, ExportQuery query)
    : path_{std::move(path)}, spans_{std::move(spans)}, query_{query} {
  if (query.grid_us) grid_.emplace(*query.grid_us);
}

MatWriter::~MatWriter() {
  if (file_ >= 0) ::close(file_);
}

Result<bool> MatWriter::advance(SQLite::Database& database) {
  if (!begun_) {
    write_facts(database);
    add_columns();
    begun_ = true;
    return true;
  }
  const bool more_of_page = push_rows();
  for (const MatColumn& column : columns_) {
    if (column.size_bytes() < kMaxColumnBytes) continue;
    return fail(
        ErrorCode::invalid,
        fmt::format("{} has more than {} bytes, which MAT version 5 does not hold; export a shorter run, or CSV",
                    column.name(), kMaxColumnBytes),
        "run_too_long");
  }
  if (more_of_page) return true;
  if (at_end_) return copy_columns();
  SegmentPage page = read_segments(database, spans_, after_, kMatPageSamples, query_.channels);
  after_ = page.next;
  at_end_ = !after_;
  grid_ ? grid_->give(std::move(page)) : segments_.give(std::move(page));
  return true;
}

void MatWriter::write_facts(SQLite::Database& database) {
  Facts facts = facts_of_run(database, query_.run);
  for (auto& names : enumerator_names()) facts.push_back(std::move(names));
  facts.emplace_back("grid_us", query_.grid_us ? std::to_string(*query_.grid_us) : "");
  std::vector<std::uint64_t> boot_ids;
  for (const RecordedSpan& span : spans_) boot_ids.push_back(span.boot_id);
  write_struct(path_, facts, boot_ids);
}

void MatWriter::add_columns() {
  using Type = MatColumn::Type;
  const auto add = [this](const std::string& name, Type type) {
    columns_.emplace_back(name, type, path_.parent_path());
  };
  const auto add_enumerator = [&]<class Enumerator>(const station::BatchField<Enumerator>& field) {
    add(field.name, Type::uint32);
    columns_.emplace_back(fmt::format("{}_text", field.name), Type::text, path_.parent_path(), words_of<Enumerator>());
  };
  add("span", Type::uint32);
  if (!grid_) {
    add("boot_id", Type::uint64);
    add("seq", Type::float64);
    add("robot_time_us", Type::float64);
  }
  add("t_s", Type::float64);
  add("utc_us", Type::float64);
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    if (query_.channels[channel]) add(text(static_cast<Channel>(channel)), Type::float32);
  }
  if (grid_) {
    add("setpoint_m", Type::float32);
    add_enumerator(kGridMode);
    add("gap", Type::uint32);
    return;
  }
  station::for_each_batch_field_of<station::FieldKind::number>(
      [&](const auto& field) { add(field.name, Type::float32); });
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    constexpr station::FieldKind kKind = station::BatchField<Value>::kKind;
    if constexpr (kKind == station::FieldKind::enumerator) {
      add_enumerator(field);
    } else if constexpr (kKind != station::FieldKind::number) {
      add(field.name, kKind == station::FieldKind::id ? Type::uint64 : Type::uint32);
    }
  });
  add("clock_uncertainty_us", Type::float64);
  add("first_received_at_us", Type::float64);
  add("received_at_us", Type::float64);
  add("gap_before", Type::float64);
  add("gap_after", Type::float64);
  add("missed_ticks_before", Type::float64);
}

// Of the page at hand; true when there are more.
bool MatWriter::push_rows() {
  for (std::size_t rows = 0; rows < kMaxGridRows; ++rows) {
    if (grid_) {
      const auto row = grid_->next();
      if (!row) return false;
      push(*row);
    } else {
      const auto segment = segments_.next();
      if (!segment) return false;
      push(*segment);
    }
  }
  return true;
}

// In the order of add_columns(), and in its types.
void MatWriter::push(const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    auto column = columns_.begin();
    const auto put = [&column](auto value) { (column++)->push(value); };
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    put(exported.part->span);
    put(exported.part->boot_id);
    put(static_cast<double>(segment.first_seq + index));
    put(static_cast<double>(robot_time_us));
    put(seconds(exported.since_us(robot_time_us)));
    put(static_cast<double>(static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us));
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      if (query_.channels[channel]) put(segment.samples[index].*kSampleMembers[channel]);
    }
    put_context(segment.context, put);
    put(static_cast<double>(segment.clock_uncertainty_us));
    put(static_cast<double>(segment.first_received_at_us));
    put(static_cast<double>(segment.received_at_us));
    put(index == 0 ? static_cast<double>(exported.gap_before) : 0.0);
    put(index + 1 == segment.samples.size() ? static_cast<double>(exported.gap_after) : 0.0);
    put(index == 0 ? static_cast<double>(exported.missed_before) : 0.0);
  }
}

void MatWriter::push(const GridRow& row) {
  auto column = columns_.begin();
  const auto put = [&column](auto value) { (column++)->push(value); };
  put(row.span);
  put(seconds(row.since_us));
  put(static_cast<double>(row.utc_us));
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    if (query_.channels[channel]) put(row.sample != nullptr ? row.sample->*kSampleMembers[channel] : kNaN);
  }
  put(row.context != nullptr ? station::or_nan(row.context->setpoint_m) : kNaN);
  put(row.context != nullptr ? static_cast<std::uint32_t>(row.context->mode) : 0);
  put(row.context != nullptr ? word_number(row.context->mode) : MatColumn::kNoWord);
  put(std::uint32_t{row.sample == nullptr});
}

// A piece of one column; false when all are there.
bool MatWriter::copy_columns() {
  if (file_ < 0) file_ = ::open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file_ < 0) fail_with(path_);
  if (copied_ == columns_.size()) return false;
  const bool more = columns_[copied_].copy_some(file_);
  if (!more) ++copied_;
  return true;
}

}  // namespace server::storage
