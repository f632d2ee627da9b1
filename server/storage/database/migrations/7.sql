-- The seventh migration: fluids and their models, retired robots, causes of events of their own, what a robot
-- says that this station does not know or cannot compute with, and positions that were measured from outside.
--
-- It adds columns and tables only: no row is rewritten.

ALTER TABLE robot ADD COLUMN fluid TEXT NOT NULL DEFAULT '';  -- that it swims in, of the configuration's list; '': not known
ALTER TABLE robot ADD COLUMN retired_at_us INTEGER;           -- NULL: in use
ALTER TABLE robot ADD COLUMN retired_by TEXT;                 -- the actor

-- The models that robots in a fluid are told: velocity = sum of gain / (1 + time constant s) of four sections. The newest
-- row of a fluid is in force; one whose numbers are NULL says that the fluid has none. Each number is a float32, exactly.
CREATE TABLE fluid_model (
  model_row INTEGER PRIMARY KEY,
  fluid TEXT NOT NULL,
  set_at_us INTEGER NOT NULL,
  set_by TEXT NOT NULL,  -- the actor
  gain_1_m_s REAL,
  gain_2_m_s REAL,
  gain_3_m_s REAL,
  gain_4_m_s REAL,
  time_constant_1_s REAL,
  time_constant_2_s REAL,
  time_constant_3_s REAL,
  time_constant_4_s REAL,
  fit_error REAL,        -- a share of the final velocity
  document TEXT          -- JSON: the plant that it was fitted to, and what else came with it
);

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

-- JSON: the numbers of enumerators that this version did not know, {"mode":17}, whose text is 'unknown'. NULL: it knew
-- all, or an earlier version stored the row, which kept the text alone.
ALTER TABLE boot ADD COLUMN unknown_values TEXT;     -- of reset_cause
ALTER TABLE segment ADD COLUMN unknown_values TEXT;  -- of mode, sub_state, emergency_cause
ALTER TABLE event ADD COLUMN unknown_values TEXT;    -- of kind, cause, mode, sub_state, emergency_cause

-- As before, with one column more.
DROP VIEW run_sample;
CREATE VIEW run_sample AS
SELECT
  run_span.run_id,
  run_span.span,
  printf('%llu', boot.boot_id) AS boot_id,
  segment.first_seq + sample.row - segment.first_row AS seq,
  segment.first_robot_time_us + (sample.row - segment.first_row) * segment.period_us AS robot_time_us,
  segment.first_robot_time_us + (sample.row - segment.first_row) * segment.period_us + segment.utc_offset_us AS utc_us,
  segment.clock_uncertainty_us,
  segment.received_at_us,
  sample.position_m,
  sample.velocity_m_s,
  sample.acceleration_m_s2,
  sample.duty,
  sample.impedance_mv,
  sample.reference_m,
  segment.mode,
  segment.sub_state,
  segment.setpoint_m,
  segment.disturbance_m,
  segment.position_sd_m,
  segment.controller_id,
  printf('%llu', segment.emergency_id) AS emergency_id,
  segment.emergency_cause,
  segment.flags,
  iif(segment.first_received_at_us = 0, segment.received_at_us, segment.first_received_at_us) AS first_received_at_us,
  segment.flags & 1 AS backfilled,
  segment.unknown_values
FROM run_span
CROSS JOIN boot
CROSS JOIN segment
CROSS JOIN sample
WHERE boot.boot_key = run_span.boot_key
  AND segment.boot_key = run_span.boot_key
  AND segment.first_seq >= run_span.first_seq - 99
  AND segment.first_seq <= coalesce(run_span.last_seq, 9223372036854775807)
  AND sample.row >= segment.first_row + max(0, run_span.first_seq - segment.first_seq)
  AND sample.row <= segment.last_row - max(0, segment.last_seq - coalesce(run_span.last_seq, 9223372036854775807));

DROP VIEW robot_boot;
CREATE VIEW robot_boot AS
SELECT robot_id, printf('%llu', boot_id) AS boot_id, boot_key, reset_cause, firmware_version, sample_period_us,
  first_seen_at_us, unknown_values
FROM boot;

DROP VIEW robot_event;
CREATE VIEW robot_event AS
SELECT event.event_row, event.robot_id, printf('%llu', boot.boot_id) AS boot_id, event.event_seq, event.robot_time_us,
  event.sample_seq, event.kind, event.cause, event.mode, event.sub_state, event.position_m, event.value,
  printf('%llu', event.emergency_id) AS emergency_id, printf('%llu', event.command_id) AS command_id,
  event.received_at_us, event.emergency_cause, event.detail, event.unknown_values
FROM event LEFT JOIN boot USING (boot_key);

-- A run's position as it was measured from outside (a camera, marks on a ruler), beside what the robot recorded: no digest
-- contains it. A run has one in use at most; those that were removed or replaced stay listed, without their positions.
CREATE TABLE outside_reference (
  reference_id INTEGER PRIMARY KEY,
  run_id INTEGER NOT NULL REFERENCES run,
  span INTEGER NOT NULL,           -- of the run: the positions are on the robot time of its boot
  source TEXT NOT NULL,            -- a name, e.g. of the file
  sha256 TEXT NOT NULL,            -- of the text that was imported
  clock_method TEXT NOT NULL,      -- offset, utc, marker, correlation
  clock_offset_s REAL NOT NULL,    -- the text's t_s + this = seconds since the first sample of the span
  clock_sd_s REAL,                 -- NULL: not known
  correlation REAL,                -- of both motions, by the method correlation, as the next
  motion_ratio REAL,               -- it moves so many times what the robot's own record does
  zero_is_kept INTEGER NOT NULL,   -- 0: zero_offset_m was estimated from the robot's own record
  zero_offset_m REAL NOT NULL,     -- was added to the text's positions
  zero_sd_m REAL,                  -- NULL: not known
  samples INTEGER NOT NULL,
  samples_left_out INTEGER NOT NULL,  -- of the text: before or after the span
  actor TEXT NOT NULL,
  made_at_us INTEGER NOT NULL,
  completed_at_us INTEGER,         -- NULL: not all of its positions are there
  removed_at_us INTEGER,           -- NULL: in use, if it is complete
  removed_by TEXT,
  removed_reason TEXT
);
CREATE INDEX outside_reference_by_run ON outside_reference(run_id);
CREATE UNIQUE INDEX outside_reference_in_use ON outside_reference(run_id)
  WHERE completed_at_us IS NOT NULL AND removed_at_us IS NULL;

CREATE TABLE outside_position (
  reference_id INTEGER NOT NULL REFERENCES outside_reference,
  robot_time_us INTEGER NOT NULL,
  position_m REAL NOT NULL,        -- with zero_offset_m in it
  position_sd_m REAL NOT NULL,
  PRIMARY KEY (reference_id, robot_time_us)
) WITHOUT ROWID;
