-- A database of schema version 1, as the program that knew no other made it: its DDL, and what it stored of two runs.
--
-- Read by tests/server/recording/migration_test.cpp. The DDL is never changed.
PRAGMA page_size = 4096;
PRAGMA auto_vacuum = INCREMENTAL;
PRAGMA application_id = 0x5268656f;
PRAGMA user_version = 1;

CREATE TABLE meta (
  name TEXT PRIMARY KEY,
  value INTEGER NOT NULL
) WITHOUT ROWID;

CREATE TABLE robot (
  robot_id TEXT PRIMARY KEY,
  token_hash BLOB,              -- BLAKE2b-256; NULL: enrolled without a token, admitted from loopback only
  enrolled_at_us INTEGER NOT NULL
) WITHOUT ROWID;

CREATE TABLE boot (
  boot_key INTEGER PRIMARY KEY,
  boot_id INTEGER NOT NULL UNIQUE,
  robot_id TEXT NOT NULL REFERENCES robot,
  reset_cause TEXT NOT NULL,
  firmware_version TEXT NOT NULL,
  sample_period_us INTEGER NOT NULL,
  first_seen_at_us INTEGER NOT NULL,
  connected_at_us INTEGER,              -- the latest time; NULL: admitted, but never connected
  announced_next_seq INTEGER NOT NULL,  -- from its latest Hello: the samples below were made
  last_robot_time_us INTEGER NOT NULL,  -- of the latest Hello or stored sample
  ended_next_seq INTEGER                -- set when a later boot of this robot connected; NULL: may go on
);
CREATE INDEX boot_by_robot ON boot(robot_id);

CREATE TABLE sample (
  row INTEGER PRIMARY KEY,
  position_m REAL,
  velocity_m_s REAL,
  acceleration_m_s2 REAL,
  duty REAL,
  impedance_mv REAL,
  reference_m REAL
);

CREATE TABLE segment (
  boot_key INTEGER NOT NULL REFERENCES boot,
  first_seq INTEGER NOT NULL,
  last_seq INTEGER NOT NULL,
  first_row INTEGER NOT NULL,
  last_row INTEGER NOT NULL,
  first_robot_time_us INTEGER NOT NULL,
  period_us INTEGER NOT NULL,
  received_at_us INTEGER NOT NULL,
  utc_offset_us INTEGER NOT NULL,
  clock_uncertainty_us INTEGER NOT NULL,
  mode TEXT NOT NULL,
  sub_state TEXT NOT NULL,
  setpoint_m REAL,
  disturbance_m REAL NOT NULL,
  position_sd_m REAL NOT NULL,
  controller_id INTEGER NOT NULL,
  emergency_id INTEGER NOT NULL,
  emergency_cause TEXT NOT NULL,
  flags INTEGER NOT NULL,
  min_position_m REAL, max_position_m REAL,
  min_velocity_m_s REAL, max_velocity_m_s REAL,
  min_acceleration_m_s2 REAL, max_acceleration_m_s2 REAL,
  min_duty REAL, max_duty REAL,
  min_impedance_mv REAL, max_impedance_mv REAL,
  min_reference_m REAL, max_reference_m REAL,
  CHECK (last_seq - first_seq = last_row - first_row),
  CHECK (last_seq - first_seq BETWEEN 0 AND 99)
);
CREATE UNIQUE INDEX segment_by_seq ON segment(boot_key, first_seq);

CREATE TABLE gap (  -- samples that are lost for good
  boot_key INTEGER NOT NULL REFERENCES boot,
  first_seq INTEGER NOT NULL,
  last_seq INTEGER NOT NULL,
  cause TEXT NOT NULL,
  noticed_at_us INTEGER NOT NULL,
  PRIMARY KEY (boot_key, first_seq),
  CHECK (last_seq >= first_seq)
) WITHOUT ROWID;

CREATE TABLE event (
  event_row INTEGER PRIMARY KEY,
  robot_id TEXT NOT NULL,
  boot_key INTEGER REFERENCES boot,  -- NULL: an event of the station
  event_seq INTEGER,
  robot_time_us INTEGER NOT NULL,
  sample_seq INTEGER NOT NULL,
  kind TEXT NOT NULL,
  cause TEXT NOT NULL,
  mode TEXT NOT NULL,
  sub_state TEXT NOT NULL,
  position_m REAL,
  value REAL,
  emergency_id INTEGER NOT NULL,
  command_id INTEGER NOT NULL,
  received_at_us INTEGER NOT NULL
);
CREATE INDEX event_by_robot ON event(robot_id);
CREATE UNIQUE INDEX event_by_seq ON event(boot_key, event_seq) WHERE event_seq IS NOT NULL;

CREATE TABLE event_gap (  -- events that are lost for good
  boot_key INTEGER NOT NULL REFERENCES boot,
  first_event_seq INTEGER NOT NULL,
  last_event_seq INTEGER NOT NULL,
  cause TEXT NOT NULL,
  noticed_at_us INTEGER NOT NULL,
  PRIMARY KEY (boot_key, first_event_seq)
) WITHOUT ROWID;

CREATE TABLE command (
  command_id INTEGER PRIMARY KEY,
  robot_id TEXT NOT NULL,
  boot_id INTEGER NOT NULL,
  kind TEXT NOT NULL,
  arguments TEXT NOT NULL,
  actor TEXT NOT NULL,
  state TEXT NOT NULL,
  reason TEXT NOT NULL,
  submitted_at_us INTEGER NOT NULL,
  sent_at_us INTEGER NOT NULL,
  ended_at_us INTEGER NOT NULL,
  effect_at_robot_us INTEGER NOT NULL,
  emergency_id INTEGER NOT NULL
);
CREATE INDEX command_by_robot ON command(robot_id, submitted_at_us);
CREATE INDEX command_unfinished ON command(kind) WHERE state IN ('queued', 'sent');

CREATE TABLE run (
  run_id INTEGER PRIMARY KEY AUTOINCREMENT,
  robot_id TEXT NOT NULL REFERENCES robot,
  name TEXT NOT NULL,
  fluid TEXT NOT NULL,
  pump_profile TEXT NOT NULL,
  mean_flow_m_s REAL,
  tube TEXT NOT NULL,
  operator_name TEXT NOT NULL,
  notes TEXT NOT NULL,
  verdict TEXT NOT NULL,
  firmware_version TEXT NOT NULL,
  controller_id INTEGER NOT NULL,
  controller_checksum INTEGER NOT NULL,
  parameters_checksum INTEGER NOT NULL,
  started_at_us INTEGER NOT NULL,
  ended_at_us INTEGER  -- NULL: the run is open
);
CREATE UNIQUE INDEX run_open ON run(robot_id) WHERE ended_at_us IS NULL;

CREATE TABLE run_span (
  run_id INTEGER NOT NULL REFERENCES run,
  span INTEGER NOT NULL,
  boot_key INTEGER NOT NULL REFERENCES boot,
  first_seq INTEGER NOT NULL,
  last_seq INTEGER,        -- NULL: the span is open
  samples_stored INTEGER,  -- both set once every sample of a closed span is stored or known lost
  samples_lost INTEGER,
  PRIMARY KEY (run_id, span),
  CHECK (last_seq >= first_seq)
) WITHOUT ROWID;
CREATE INDEX run_span_open ON run_span(boot_key) WHERE last_seq IS NULL;

-- CROSS JOIN fixes the order: span, its segments by index, their rows by number. A segment that holds a span's first
-- sample begins at most 99 before it.
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
  segment.flags
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

CREATE VIEW robot_boot AS
SELECT robot_id, printf('%llu', boot_id) AS boot_id, boot_key, reset_cause, firmware_version, sample_period_us,
  first_seen_at_us
FROM boot;

CREATE VIEW robot_gap AS
SELECT boot.robot_id, printf('%llu', boot.boot_id) AS boot_id, gap.first_seq, gap.last_seq,
  gap.last_seq - gap.first_seq + 1 AS samples, gap.cause, gap.noticed_at_us
FROM gap JOIN boot USING (boot_key);

CREATE VIEW run_gap AS
SELECT run_span.run_id, run_span.span, printf('%llu', boot.boot_id) AS boot_id,
  max(gap.first_seq, run_span.first_seq) AS first_seq,
  min(gap.last_seq, coalesce(run_span.last_seq, gap.last_seq)) AS last_seq,
  gap.cause, gap.noticed_at_us
FROM run_span
CROSS JOIN boot
CROSS JOIN gap
WHERE boot.boot_key = run_span.boot_key
  AND gap.boot_key = run_span.boot_key
  AND gap.last_seq >= run_span.first_seq
  AND gap.first_seq <= coalesce(run_span.last_seq, 9223372036854775807);

CREATE VIEW robot_event AS
SELECT event.event_row, event.robot_id, printf('%llu', boot.boot_id) AS boot_id, event.event_seq, event.robot_time_us,
  event.sample_seq, event.kind, event.cause, event.mode, event.sub_state, event.position_m, event.value,
  printf('%llu', event.emergency_id) AS emergency_id, printf('%llu', event.command_id) AS command_id,
  event.received_at_us
FROM event LEFT JOIN boot USING (boot_key);

CREATE VIEW robot_command AS
SELECT printf('%llu', command_id) AS command_id, robot_id, printf('%llu', boot_id) AS boot_id, kind, arguments, actor,
  state, reason, submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us,
  printf('%llu', emergency_id) AS emergency_id
FROM command;

-- Robot nemo in two boots: the run that ended spans both and holds a gap, NULLs and a setpoint; the other one is open.
INSERT INTO meta VALUES ('store_id', -81985529216486896), ('next_row', 301);
INSERT INTO robot VALUES ('nemo', NULL, 1700000000000000);
INSERT INTO boot VALUES
  (1, -81985529216486896, 'nemo', 'power_on', '1.2.3', 10000, 1700000000000000, 1700000000000000, 0, 2690000, 220),
  (2, 4711, 'nemo', 'watchdog', '1.2.3', 10000, 1700000100000000, 1700000100000000, 0, 1490000, NULL);
WITH RECURSIVE number(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM number WHERE n < 300)
INSERT INTO sample SELECT n, n / 1024.0, iif(n % 7 = 0, NULL, -n / 64.0), NULL, 0.5, 175.0, iif(n > 100, 0.25, NULL) FROM number;
INSERT INTO segment VALUES
  (1, 0, 99, 1, 100, 500000, 10000, 1700000001500000, 1700000000000000, 300, 'manual', 'none',
   NULL, 0.0, 0.001, 0, 0, 'none', 0, 0.0009765625, 0.09765625, -1.5625, -0.015625, NULL, NULL, 0.5, 0.5, 175.0, 175.0, NULL, NULL),
  (1, 100, 149, 101, 150, 1500000, 10000, 1700000002000000, 1700000000000000, 300, 'auto', 'navigating',
   0.25, -0.5, 0.001, 7, -81985529216486896, 'operator', 1, 0.0986328125, 0.146484375, -2.34375, -1.578125, NULL, NULL, 0.5, 0.5, 175.0, 175.0, 0.25, 0.25),
  (1, 160, 219, 151, 210, 2100000, 10000, 1700000003000000, 1700000000000000, -1, 'auto', 'navigating',
   0.25, 0.0, 0.001, 7, 0, 'none', 0, 0.1474609375, 0.205078125, -3.265625, -2.359375, NULL, NULL, 0.5, 0.5, 175.0, 175.0, 0.25, 0.25),
  (2, 0, 89, 211, 300, 600000, 10000, 1700000101000000, 1700000100000000, 250, 'manual', 'none',
   NULL, 0.0, 0.001, 0, 0, 'none', 0, 0.2060546875, 0.29296875, -4.6875, -3.296875, NULL, NULL, 0.5, 0.5, 175.0, 175.0, 0.25, 0.25);
INSERT INTO gap VALUES (1, 150, 159, 'ring_overrun', 1700000002500000);
INSERT INTO event (robot_id, boot_key, event_seq, robot_time_us, sample_seq, kind, cause, mode, sub_state, position_m,
  value, emergency_id, command_id, received_at_us) VALUES
  ('nemo', 2, 0, 600000, 0, 'emergency', 'operator', 'emergency', 'none', 0.0, NULL, 99, 0, 1700000100500000),
  ('nemo', 2, 1, 700000, 10, 'mode_changed', 'operator', 'emergency', 'none', 0.0, NULL, 99, 0, 1700000100600000);
INSERT INTO run VALUES
  (1, 'nemo', 'ended', 'water', 'none', 0.25, '', 'ana', 'first', 'good', '1.2.3', 7, 8, 9, 1700000001000000, 1700000100800000),
  (2, 'nemo', 'open', '', '', NULL, '', '', '', '', '1.2.3', 0, 0, 0, 1700000100900000, NULL);
INSERT INTO run_span VALUES (1, 0, 1, 50, 219, 160, 10), (1, 1, 2, 0, 29, NULL, NULL), (2, 0, 2, 30, NULL, NULL, NULL);
