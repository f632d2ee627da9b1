// Each end of the window is looked for in each boot.
#include "server/storage/query/span_finder.hpp"

#include "server/storage/samples/boot_times.hpp"

namespace server::storage {

std::vector<RecordedSpan> cut_to_window(SQLite::Database& database, std::span<RecordedSpan> spans, TimeWindow window) {
  std::vector<RecordedSpan> found;
  BootTimes times{database};
  for (RecordedSpan& span : spans) {
    times.enter(span.boot_key, span.waiting);
    const auto first = times.first_from(window.from_us);
    if (!first) continue;
    const std::uint64_t next = times.first_from(window.to_us).value_or(*first);
    span.cut({*first, next});
    if (span.made().next > span.samples.first) found.push_back(std::move(span));
  }
  return found;
}

}  // namespace server::storage
