// What a view has beside the columns of its table is of the run, or follows from them.
#include "server/storage/export/run_file_views.hpp"

#include "server/station/state/telemetry_fields.hpp"

namespace server::storage {
namespace {

std::string run_sample() {
  std::string sql =
      "CREATE VIEW run_sample AS SELECT (SELECT run_id FROM run) AS run_id, span, boot_id, seq, robot_time_us, utc_us, "
      "clock_uncertainty_us,"
      " received_at_us";
  const auto add = [&](const auto& field) { (sql += ", ") += field.name; };
  station::for_each_sample_field(add);
  station::for_each_batch_field(add);
  return sql + ", first_received_at_us, flags & 1 AS backfilled, unknown_values FROM sample;";
}

constexpr const char* kOthers = R"sql(
CREATE VIEW run_gap AS SELECT run_id, span, boot_id, first_seq, last_seq, cause, noticed_at_us FROM run CROSS JOIN gap;
CREATE VIEW robot_gap AS SELECT robot_id, boot_id, first_seq, last_seq, last_seq - first_seq + 1 AS samples, cause,
  noticed_at_us FROM run CROSS JOIN gap;
CREATE VIEW robot_boot AS SELECT * FROM boot;
CREATE VIEW run_marker AS SELECT * FROM marker;
CREATE VIEW run_in_force AS SELECT * FROM in_force;
CREATE VIEW boot_clock AS SELECT * FROM clock;
CREATE VIEW robot_event AS SELECT * FROM event;
CREATE VIEW robot_command AS SELECT * FROM command;
)sql";

}  // namespace

std::string run_file_views() { return run_sample() + kOthers; }

}  // namespace server::storage
