// What a run recorded: samples as JSON pages and as CSV, and the gaps.
#include <fmt/format.h>

#include <charconv>
#include <limits>

#include "server/api/routes.hpp"

namespace server {
namespace asio = boost::asio;
using nlohmann::json;

std::string cursor_text(const SampleCursor& cursor) { return fmt::format("{}-{}", cursor.span, cursor.seq); }

std::optional<SampleCursor> parse_cursor(const std::string& text) {
  SampleCursor cursor;
  const char* end = text.data() + text.size();
  const auto span = std::from_chars(text.data(), end, cursor.span);
  if (span.ec != std::errc{} || span.ptr == end || *span.ptr != '-') return std::nullopt;
  const auto seq = std::from_chars(span.ptr + 1, end, cursor.seq);
  const bool is_number = seq.ec == std::errc{} && seq.ptr == end;
  if (!is_number || cursor.seq > std::numeric_limits<std::int64_t>::max()) return std::nullopt;  // beyond any sample
  return cursor;
}

namespace {

constexpr std::int64_t kMaxPage = 10000;
constexpr std::int64_t kDefaultPage = 1000;
constexpr std::size_t kCsvPage = 2000;  // samples held in memory at a time, about 300 kB of text

// Text of many samples takes milliseconds: it is made on the readers' thread, never on the loop.
std::string page_text(const SamplePage& page) {
  json body = list_json("samples", page.samples);
  body["next"] = page.next ? json(cursor_text(*page.next)) : json(nullptr);
  return dump(body);
}

Answer list_samples(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto limit = query_number(request, "limit", 1, kMaxPage, kDefaultPage);
  if (!limit) co_return problem(limit.error());
  std::optional<SampleCursor> after;
  if (const auto given = request.query.find("after"); given != request.query.end()) {
    after = parse_cursor(given->second);
    if (!after) co_return problem(400, "after is not the `next` of a page", "out_of_range");
  }
  auto page = co_await parts.recording.history.samples(*id, after, static_cast<std::size_t>(*limit));
  if (!page) co_return problem(page.error());
  auto job = [page = std::move(*page)] { return page_text(page); };
  std::string text = co_await parts.recording.history.on_reader(std::move(job));
  co_return json_text_response(200, std::move(text));
}

Answer list_gaps(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto gaps = co_await parts.recording.history.gaps(*id);
  if (!gaps) co_return problem(gaps.error());
  co_return json_response(200, list_json("gaps", *gaps));
}

constexpr const char* kCsvHeader =
    "span,boot_id,seq,robot_time_us,utc,position_m,velocity_m_s,acceleration_m_s2,duty,impedance_mv,reference_m,mode,"
    "sub_state,setpoint_m,disturbance_m\n";

// "2026-03-01T12:00:00.000001Z"
std::string utc_text(std::int64_t utc_us) {
  const std::chrono::sys_time<microseconds> time{microseconds{utc_us}};
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day date{day};
  const std::chrono::hh_mm_ss clock{time - day};
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:06}Z", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), clock.hours().count(),
                     clock.minutes().count(), clock.seconds().count(), clock.subseconds().count());
}

void append_csv(std::string& out, const StoredSample& stored) {
  const Sample& sample = stored.sample;
  const std::string setpoint = stored.setpoint_m ? fmt::format("{}", *stored.setpoint_m) : "";
  fmt::format_to(std::back_inserter(out), "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", stored.span, stored.boot_id,
                 stored.seq, stored.robot_time_us, utc_text(stored.utc_us), sample.position_m, sample.velocity_m_s,
                 sample.acceleration_m_s2, sample.duty, sample.impedance_mv, sample.reference_m,
                 protocol::text(stored.mode), protocol::text(stored.sub_state), setpoint, stored.disturbance_m);
}

std::string csv_text(const SamplePage& page, std::string text) {
  for (const StoredSample& sample : page.samples) append_csv(text, sample);
  return text;
}

// The run page by page, so that memory does not grow with its length.
class CsvStream final : public BodyStream {
 public:
  CsvStream(History& history, RunId run, SamplePage first) : history_{history}, run_{run}, page_{std::move(first)} {}

  asio::awaitable<Result<std::optional<std::string>>> next() override {
    if (begun_) {
      if (!next_) co_return std::optional<std::string>{};
      auto page = co_await history_.samples(run_, next_, kCsvPage);
      if (!page) co_return std::unexpected{page.error()};
      page_ = std::move(*page);
    }
    next_ = page_.next;
    auto job = [page = std::move(page_), header = begun_ ? "" : kCsvHeader] { return csv_text(page, header); };
    begun_ = true;
    std::string text = co_await history_.on_reader(std::move(job));
    co_return std::optional{std::move(text)};
  }

 private:
  History& history_;
  RunId run_;
  SamplePage page_;                   // the first, then the one being written
  std::optional<SampleCursor> next_;  // of the page before
  bool begun_ = false;
};

Answer export_samples(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  auto first = co_await parts.recording.history.samples(*id, std::nullopt, kCsvPage);
  if (!first) co_return problem(first.error());
  Response response;
  response.content_type = "text/csv; charset=utf-8";
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Disposition", fmt::format("attachment; filename=\"run-{}.csv\"", *id));
  response.stream = std::make_unique<CsvStream>(parts.recording.history, *id, std::move(*first));
  co_return response;
}

}  // namespace

void add_sample_routes(Router& router, ApiParts& parts) {
  const auto add = [&router, &parts](const char* pattern, std::vector<std::string> query,
                                     Answer (*answer)(ApiParts&, Request)) {
    router.add({"GET", pattern, std::move(query),
                [&parts, answer](Request request) { return answer(parts, std::move(request)); }});
  };
  add("/api/v1/runs/{run_id}/samples", {"after", "limit"}, list_samples);
  add("/api/v1/runs/{run_id}/samples.csv", {}, export_samples);
  add("/api/v1/runs/{run_id}/gaps", {}, list_gaps);
}

}  // namespace server
