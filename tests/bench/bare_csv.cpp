// Prints a run as the station's CSV export does, with nothing around it: the yardstick of tests/bench/query_bench.
//
//   bare_csv DATABASE RUN > run.csv
//
// One statement over segments, one over rows, std::to_chars into one buffer. It believes the database, knows no gaps
// and no waiting samples, and never stops for anybody else. Prints at the end, to the standard error: rows and seconds
// of CPU.
#include <sqlite3.h>
#include <sys/resource.h>

#include <charconv>
#include <cstdio>
#include <ctime>
#include <stdexcept>
#include <string>

namespace {

constexpr int kChannels = 6;
constexpr std::size_t kBufferBytes = 65536;
constexpr std::int64_t kSecondUs = 1'000'000;

class Query {
 public:
  Query(sqlite3* handle, const char* sql) {
    if (sqlite3_prepare_v2(handle, sql, -1, &statement_, nullptr) != SQLITE_OK) {
      throw std::runtime_error{sqlite3_errmsg(handle)};
    }
  }
  ~Query() { sqlite3_finalize(statement_); }
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;

  void bind(int index, std::int64_t value) { sqlite3_bind_int64(statement_, index, value); }
  bool next() { return sqlite3_step(statement_) == SQLITE_ROW; }
  void reset() { sqlite3_reset(statement_); }
  std::int64_t integer(int column) { return sqlite3_column_int64(statement_, column); }
  bool is_null(int column) { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
  float real(int column) { return static_cast<float>(sqlite3_column_double(statement_, column)); }
  std::string text(int column) {
    const auto* found = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
    return found == nullptr ? "" : found;
  }

 private:
  sqlite3_stmt* statement_ = nullptr;
};

class Printer {
 public:
  ~Printer() { flush(); }
  Printer() = default;
  Printer(const Printer&) = delete;
  Printer& operator=(const Printer&) = delete;

  template <class Number>
  void number(Number value) {
    at_ = static_cast<std::size_t>(std::to_chars(buffer_ + at_, buffer_ + sizeof buffer_, value).ptr - buffer_);
  }
  void text(const std::string& value) { at_ += value.copy(buffer_ + at_, sizeof buffer_ - at_); }
  void mark(char value) { buffer_[at_++] = value; }
  void utc(std::int64_t utc_us) {
    const std::int64_t second = utc_us / kSecondUs;
    if (second != second_) {
      const std::time_t time = second;
      std::tm parts{};
      gmtime_r(&time, &parts);
      char text[32];
      beginning_.assign(text, std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S.", &parts));
      second_ = second;
    }
    text(beginning_);
    micros(utc_us % kSecondUs);
    mark('Z');
  }
  void seconds(std::int64_t time_us) {
    number(time_us / kSecondUs);
    mark('.');
    micros(time_us % kSecondUs);
  }
  void end_line() {
    mark('\n');
    if (at_ > kBufferBytes) flush();
  }

 private:
  void micros(std::int64_t value) {
    for (std::size_t place = 6; place-- > 0; value /= 10) {
      buffer_[at_ + place] = static_cast<char>('0' + value % 10);
    }
    at_ += 6;
  }
  void flush() {
    std::fwrite(buffer_, 1, at_, stdout);
    at_ = 0;
  }

  char buffer_[kBufferBytes + 4096];
  std::size_t at_ = 0;
  std::int64_t second_ = -1;
  std::string beginning_;
};

std::int64_t print_run(sqlite3* handle, std::int64_t run) {
  Query segments{
      handle,
      "SELECT span, printf('%llu', boot_id), max(segment.first_seq, run_span.first_seq),"
      " min(segment.last_seq, coalesce(run_span.last_seq, 9223372036854775807)),"
      " segment.first_seq, first_row, first_robot_time_us, period_us, utc_offset_us, mode, sub_state,"
      " setpoint_m, disturbance_m, clock_uncertainty_us, first_received_at_us, received_at_us, position_sd_m,"
      " controller_id, emergency_id, emergency_cause, flags FROM run_span CROSS JOIN boot CROSS JOIN segment WHERE "
      "run_id = ?"
      " AND boot.boot_key = run_span.boot_key AND segment.boot_key = run_span.boot_key"
      " AND segment.first_seq >= run_span.first_seq - 99"
      " AND segment.first_seq <= coalesce(run_span.last_seq, 9223372036854775807)"
      " ORDER BY span, segment.first_seq"};
  Query rows{handle,
             "SELECT position_m, velocity_m_s, acceleration_m_s2, duty, impedance_mv, reference_m FROM sample"
             " WHERE row BETWEEN ? AND ?"};
  segments.bind(1, run);
  Printer out;
  std::int64_t printed = 0, span = -1, begin_us = 0;
  while (segments.next()) {
    const std::int64_t first_seq = segments.integer(2), last_seq = segments.integer(3);
    if (first_seq > last_seq) continue;
    const std::string beginning = segments.text(0) + ',' + segments.text(1) + ',';
    std::string end = "," + segments.text(9) + ',' + segments.text(10);
    for (int column = 11; column <= 20; ++column) end += ',' + segments.text(column);
    const std::int64_t skipped = first_seq - segments.integer(4);
    const std::int64_t first_row = segments.integer(5) + skipped;
    std::int64_t robot_time_us = segments.integer(6) + skipped * segments.integer(7);
    if (span != segments.integer(0)) begin_us = robot_time_us;
    span = segments.integer(0);
    rows.bind(1, first_row);
    rows.bind(2, first_row + last_seq - first_seq);
    for (std::int64_t seq = first_seq; rows.next(); ++seq, robot_time_us += segments.integer(7)) {
      out.text(beginning);
      out.number(seq);
      out.mark(',');
      out.number(robot_time_us);
      out.mark(',');
      out.seconds(robot_time_us - begin_us);
      out.mark(',');
      out.utc(robot_time_us + segments.integer(8));
      for (int channel = 0; channel < kChannels; ++channel) {
        out.mark(',');
        if (!rows.is_null(channel)) out.number(rows.real(channel));
      }
      out.text(end);
      out.text(",0,0");
      out.end_line();
      ++printed;
    }
    rows.reset();
  }
  return printed;
}

}  // namespace

int main(int argc, char** argv) try {
  sqlite3* handle = nullptr;
  if (argc != 3) throw std::runtime_error{"say DATABASE and RUN"};
  if (sqlite3_open_v2(argv[1], &handle, SQLITE_OPEN_READONLY, nullptr) != SQLITE_OK) {
    throw std::runtime_error{sqlite3_errmsg(handle)};
  }
  const std::int64_t printed = print_run(handle, std::stoll(argv[2]));
  sqlite3_close(handle);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
  };
  std::fprintf(stderr, "%lld rows, %.3f s\n", static_cast<long long>(printed),
               seconds(usage.ru_utime) + seconds(usage.ru_stime));
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "bare_csv: %s\n", error.what());
  return 1;
}
