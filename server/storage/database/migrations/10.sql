-- The tenth migration: renewals of a lease in a row are one row; retention of events.
--
-- It adds columns and indices: no row is rewritten. Each renewal of before has a row of its own, which none follows.

-- Of a renewal (kind renew_lease): those that the robot accepted right after it, and that have no row of their own. NULL:
-- not known, since they go on, or, where `reason` is 'station_restarted', since the station ended before they did.
ALTER TABLE command ADD COLUMN further_renewals INTEGER DEFAULT 0;
ALTER TABLE command ADD COLUMN last_renewed_at_us INTEGER;  -- when the last of them was requested; NULL: none, or not known
CREATE INDEX command_renewed ON command(command_id) WHERE further_renewals IS NULL;

DROP VIEW robot_command;
CREATE VIEW robot_command AS
SELECT printf('%llu', command_id) AS command_id, robot_id, printf('%llu', boot_id) AS boot_id, kind, arguments, actor,
  state, reason, submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us,
  printf('%llu', emergency_id) AS emergency_id, sent_after_us, acknowledged_after_us, verified_after_us, life_from,
  further_renewals, last_renewed_at_us
FROM command;

-- Whether a run holds an event is asked of each that is old.
CREATE INDEX run_span_by_boot ON run_span(boot_key);
