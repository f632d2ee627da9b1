// SQL of the seventh migration: fluids and retired robots, causes of events of their own, and what a robot says that
// this station does not know or cannot compute with.
//
// It adds columns and tables only: no row is rewritten.
#include "server/recording/schema.hpp"

namespace server {

const char* const kSeventhSchema = R"sql(
ALTER TABLE robot ADD COLUMN fluid TEXT NOT NULL DEFAULT '';  -- that it swims in, of the configuration's list; '': not known
ALTER TABLE robot ADD COLUMN retired_at_us INTEGER;           -- NULL: in use
ALTER TABLE robot ADD COLUMN retired_by TEXT;                 -- the actor

-- Of the latch in force after the event. NULL: an earlier version stored it. That wrote the cause of the latch over
-- `cause` in a robot's event, where there was a latch, and a sentence into `cause` of the station's own.
ALTER TABLE event ADD COLUMN emergency_cause TEXT;
ALTER TABLE event ADD COLUMN detail TEXT NOT NULL DEFAULT '';  -- for people; of the station's own

-- What a robot says once for many samples may be no finite number, as each channel may: NULL. SQLite's way to take a NOT
-- NULL away without writing a row anew (its documentation of ALTER TABLE, "other kinds of table schema changes").
PRAGMA writable_schema = ON;
UPDATE sqlite_schema SET sql = replace(replace(sql, 'disturbance_m REAL NOT NULL', 'disturbance_m REAL'),
  'position_sd_m REAL NOT NULL', 'position_sd_m REAL') WHERE type = 'table' AND name = 'segment';
PRAGMA writable_schema = RESET;

DROP VIEW robot_event;
CREATE VIEW robot_event AS
SELECT event.event_row, event.robot_id, printf('%llu', boot.boot_id) AS boot_id, event.event_seq, event.robot_time_us,
  event.sample_seq, event.kind, event.cause, event.mode, event.sub_state, event.position_m, event.value,
  printf('%llu', event.emergency_id) AS emergency_id, printf('%llu', event.command_id) AS command_id,
  event.received_at_us, event.emergency_cause, event.detail
FROM event LEFT JOIN boot USING (boot_key);
)sql";

}  // namespace server
