CREATE TABLE meta (
  name TEXT PRIMARY KEY,
  value INTEGER NOT NULL
) WITHOUT ROWID;
CREATE TABLE robot (
  robot_id TEXT PRIMARY KEY,
  token_hash BLOB,              -- BLAKE2b-256; NULL: enrolled without a token, admitted from loopback only
  enrolled_at_us INTEGER NOT NULL
, enrolled_by TEXT NOT NULL DEFAULT 'loopback', revoked_at_us INTEGER, revoked_by TEXT, fluid TEXT NOT NULL DEFAULT '', retired_at_us INTEGER, retired_by TEXT) WITHOUT ROWID;
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
, durable_next_seq INTEGER NOT NULL DEFAULT 0, durable_next_event_seq INTEGER NOT NULL DEFAULT 0, announced_next_event_seq INTEGER NOT NULL DEFAULT 0, unknown_values TEXT, grouped_next_seq INTEGER NOT NULL DEFAULT 0);
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
  disturbance_m REAL,
  position_sd_m REAL,
  controller_id INTEGER NOT NULL,
  emergency_id INTEGER NOT NULL,
  emergency_cause TEXT NOT NULL,
  flags INTEGER NOT NULL,
  min_position_m REAL, max_position_m REAL,
  min_velocity_m_s REAL, max_velocity_m_s REAL,
  min_acceleration_m_s2 REAL, max_acceleration_m_s2 REAL,
  min_duty REAL, max_duty REAL,
  min_impedance_mv REAL, max_impedance_mv REAL,
  min_reference_m REAL, max_reference_m REAL, first_received_at_us INTEGER NOT NULL DEFAULT 0, unknown_values TEXT,
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
, emergency_cause TEXT, detail TEXT NOT NULL DEFAULT '', unknown_values TEXT);
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
, sent_after_us INTEGER, acknowledged_after_us INTEGER, verified_after_us INTEGER, life_from TEXT NOT NULL DEFAULT '', peer TEXT NOT NULL DEFAULT '', audit_entry INTEGER, further_renewals INTEGER DEFAULT 0, last_renewed_at_us INTEGER);
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
, state TEXT NOT NULL DEFAULT 'open', made_afterwards INTEGER NOT NULL DEFAULT 0, made_by TEXT NOT NULL DEFAULT '', profile TEXT NOT NULL DEFAULT '');
CREATE TABLE sqlite_sequence(name,seq);
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
CREATE INDEX event_of_latch ON event(boot_key, event_seq)
  WHERE event_seq IS NOT NULL AND kind IN ('emergency', 'emergency_cleared');
CREATE TABLE clock_estimate (       -- of a connected boot, from time to time and at each jump
  boot_key INTEGER NOT NULL REFERENCES boot,
  robot_time_us INTEGER NOT NULL,
  utc_offset_us INTEGER NOT NULL,   -- UTC = robot time + this
  uncertainty_us INTEGER NOT NULL,
  drift_ppm REAL NOT NULL,
  round_trip_us INTEGER NOT NULL,
  station_step_us INTEGER NOT NULL, -- the station's UTC was set by so much since the row before; 0: it was not
  PRIMARY KEY (boot_key, robot_time_us)
) WITHOUT ROWID;
CREATE TABLE run_note (             -- every change of what was said of a run: nothing is overwritten unseen
  note_id INTEGER PRIMARY KEY,
  run_id INTEGER NOT NULL REFERENCES run,
  made_at_us INTEGER NOT NULL,
  actor TEXT NOT NULL,
  field TEXT NOT NULL,
  before TEXT NOT NULL,
  after TEXT NOT NULL
);
CREATE INDEX run_note_by_run ON run_note(run_id);
CREATE TABLE marker (               -- of the recording; a run shows those in its spans
  marker_id INTEGER PRIMARY KEY,
  boot_key INTEGER NOT NULL REFERENCES boot,
  seq INTEGER NOT NULL,
  text TEXT NOT NULL,
  actor TEXT NOT NULL,
  made_at_us INTEGER NOT NULL
);
CREATE INDEX marker_by_seq ON marker(boot_key, seq);
CREATE TABLE document (             -- a text that was in force; equal texts are stored once
  document_key INTEGER PRIMARY KEY,
  kind TEXT NOT NULL,               -- controller, parameters, station
  sha256 BLOB NOT NULL,             -- of content
  content TEXT NOT NULL,            -- JSON
  UNIQUE (kind, sha256)
);
CREATE TABLE in_force (             -- from this sample of the boot on, until the next row of the same kind
  boot_key INTEGER NOT NULL REFERENCES boot,
  kind TEXT NOT NULL,
  first_seq INTEGER NOT NULL,
  document_key INTEGER NOT NULL REFERENCES document,
  noticed_at_us INTEGER NOT NULL,
  PRIMARY KEY (boot_key, kind, first_seq)
) WITHOUT ROWID;
CREATE TABLE run_certificate (
  run_id INTEGER PRIMARY KEY REFERENCES run,
  format INTEGER NOT NULL,
  samples_expected INTEGER NOT NULL,
  samples_live INTEGER NOT NULL,
  samples_backfilled INTEGER NOT NULL,
  samples_lost INTEGER NOT NULL,
  lost_by_cause TEXT NOT NULL,      -- JSON object
  longest_gap_samples INTEGER NOT NULL,
  longest_gap_us INTEGER NOT NULL,
  worst_clock_uncertainty_us INTEGER NOT NULL,
  samples_without_clock INTEGER NOT NULL,
  sha256 TEXT NOT NULL,             -- of the samples, in lower-case hexadecimal
  made_at_us INTEGER NOT NULL
, missed_ticks INTEGER, longest_missed_ticks INTEGER);
CREATE VIEW run_marker AS
SELECT run_span.run_id, run_span.span, marker.marker_id, printf('%llu', boot.boot_id) AS boot_id, marker.seq,
  marker.text, marker.actor, marker.made_at_us
FROM run_span
CROSS JOIN boot
CROSS JOIN marker
WHERE boot.boot_key = run_span.boot_key
  AND marker.boot_key = run_span.boot_key
  AND marker.seq >= run_span.first_seq
  AND marker.seq <= coalesce(run_span.last_seq, 9223372036854775807);
CREATE VIEW run_in_force AS
SELECT run_span.run_id, run_span.span, in_force.kind, max(in_force.first_seq, run_span.first_seq) AS first_seq,
  document.content, lower(hex(document.sha256)) AS sha256
FROM run_span
CROSS JOIN in_force
CROSS JOIN document
WHERE in_force.boot_key = run_span.boot_key
  AND document.document_key = in_force.document_key
  AND in_force.first_seq <= coalesce(run_span.last_seq, 9223372036854775807)
  AND NOT EXISTS (
    SELECT 1 FROM in_force AS later
    WHERE later.boot_key = in_force.boot_key AND later.kind = in_force.kind
      AND later.first_seq > in_force.first_seq AND later.first_seq <= run_span.first_seq);
CREATE VIEW boot_clock AS
SELECT boot.robot_id, printf('%llu', boot.boot_id) AS boot_id, clock_estimate.robot_time_us,
  clock_estimate.robot_time_us + clock_estimate.utc_offset_us AS utc_us, clock_estimate.utc_offset_us,
  clock_estimate.uncertainty_us, clock_estimate.drift_ppm, clock_estimate.round_trip_us, clock_estimate.station_step_us
FROM clock_estimate JOIN boot USING (boot_key);
CREATE TABLE user (
  name TEXT PRIMARY KEY,
  role TEXT NOT NULL CHECK (role IN ('viewer', 'operator', 'admin')),
  password_hash TEXT NOT NULL,          -- Argon2id with its salt and cost, as libsodium writes it
  made_at_us INTEGER NOT NULL,
  made_by TEXT NOT NULL,                -- the actor
  disabled INTEGER NOT NULL DEFAULT 0   -- may not sign in
) WITHOUT ROWID;
CREATE TABLE api_token (
  name TEXT PRIMARY KEY,
  hash BLOB NOT NULL UNIQUE,            -- BLAKE2b-256
  scopes TEXT NOT NULL,                 -- of read, stop, record, command, admin: 'read,stop'
  owner TEXT NOT NULL,                  -- a user, whose role bounds it; '': the station
  made_at_us INTEGER NOT NULL,
  last_used_at_us INTEGER NOT NULL,     -- to the minute; 0: never
  expires_at_us INTEGER NOT NULL,       -- 0: never
  revoked_at_us INTEGER NOT NULL        -- 0: it is good
, expired_at_us INTEGER NOT NULL DEFAULT 0) WITHOUT ROWID;
CREATE TABLE page_session (
  session INTEGER PRIMARY KEY,          -- never given twice: meta holds next_session
  hash BLOB NOT NULL UNIQUE,            -- BLAKE2b-256 of the cookie
  user TEXT NOT NULL,                   -- '': let in by a one-time link
  made_at_us INTEGER NOT NULL,
  last_used_at_us INTEGER NOT NULL,     -- to the hour
  ends_at_us INTEGER NOT NULL,
  peer TEXT NOT NULL,                   -- the address it was made from
  agent TEXT NOT NULL                   -- what the browser said it was
);
CREATE TABLE audit (
  entry INTEGER PRIMARY KEY,     -- 1, 2, 3 and so on, without holes
  at_us INTEGER NOT NULL,        -- UTC when it happened; entries are in the order in which they were written
  actor TEXT NOT NULL,           -- who
  peer TEXT NOT NULL,            -- from which address; '': from none
  robot_id TEXT NOT NULL,        -- '': the station itself
  action TEXT NOT NULL,
  subject TEXT NOT NULL,
  detail TEXT NOT NULL,          -- JSON object
  salt BLOB NOT NULL,            -- 16 random bytes: whoever knows only content_hash cannot guess the content
  content_hash BLOB NOT NULL,    -- BLAKE2b-256 of at_us to salt
  hash BLOB NOT NULL             -- BLAKE2b-256 of the hash before, entry and content_hash
);
CREATE INDEX audit_by_time ON audit(at_us);
CREATE TRIGGER audit_in_order BEFORE INSERT ON audit
WHEN NEW.entry IS NOT (SELECT coalesce(max(entry), 0) + 1 FROM audit)
BEGIN SELECT RAISE(ABORT, 'entries of the audit are numbered without holes'); END;
CREATE TRIGGER audit_unchanged BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'entries of the audit are never changed'); END;
CREATE TRIGGER audit_kept BEFORE DELETE ON audit
BEGIN SELECT RAISE(ABORT, 'entries of the audit are never removed'); END;
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
, assumed_because TEXT NOT NULL DEFAULT '');
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
CREATE VIEW robot_boot AS
SELECT robot_id, printf('%llu', boot_id) AS boot_id, boot_key, reset_cause, firmware_version, sample_period_us,
  first_seen_at_us, unknown_values
FROM boot;
CREATE VIEW robot_event AS
SELECT event.event_row, event.robot_id, printf('%llu', boot.boot_id) AS boot_id, event.event_seq, event.robot_time_us,
  event.sample_seq, event.kind, event.cause, event.mode, event.sub_state, event.position_m, event.value,
  printf('%llu', event.emergency_id) AS emergency_id, printf('%llu', event.command_id) AS command_id,
  event.received_at_us, event.emergency_cause, event.detail, event.unknown_values
FROM event LEFT JOIN boot USING (boot_key);
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
CREATE TABLE job (
  job_id INTEGER PRIMARY KEY,
  kind TEXT NOT NULL,            -- identify, tune
  state TEXT NOT NULL,           -- waiting, running, done, failed, cancelled, interrupted: the station stopped before
  owner TEXT NOT NULL,           -- the actor
  request TEXT NOT NULL,         -- JSON
  created_at_us INTEGER NOT NULL,
  started_at_us INTEGER,         -- NULL: it has not been begun
  ended_at_us INTEGER,           -- NULL: it has not ended
  result TEXT,                   -- JSON; of one that is done
  error TEXT                     -- of one that failed, in words
);
CREATE TABLE design (
  design_id INTEGER PRIMARY KEY,
  kind TEXT NOT NULL,                       -- model, controller
  name TEXT NOT NULL,
  notes TEXT NOT NULL,
  document TEXT NOT NULL,                   -- JSON, which the command line tools read as a plant or a controller
  sha256 TEXT NOT NULL,                     -- of document
  parent_id INTEGER REFERENCES design,      -- of the same kind: this one is a change of it
  model_id INTEGER REFERENCES design,       -- of a controller: the model that it was designed for
  options TEXT NOT NULL,                    -- JSON: how it was made
  made_with TEXT NOT NULL,                  -- version of the program
  made_by TEXT NOT NULL,                    -- the actor
  made_at_us INTEGER NOT NULL
);
CREATE TABLE design_source (
  design_id INTEGER NOT NULL REFERENCES design,
  source INTEGER NOT NULL,                  -- from 0
  run_id INTEGER NOT NULL,
  span INTEGER,                             -- NULL: its only one
  PRIMARY KEY (design_id, source)
) WITHOUT ROWID;
CREATE INDEX design_source_by_run ON design_source(run_id);
CREATE TRIGGER design_is_never_changed BEFORE UPDATE ON design
BEGIN SELECT RAISE(ABORT, 'a design is never changed: store a new one with a parent'); END;
CREATE TRIGGER design_is_never_removed BEFORE DELETE ON design
BEGIN SELECT RAISE(ABORT, 'a design is never removed'); END;
CREATE TRIGGER design_source_is_never_changed BEFORE UPDATE ON design_source
BEGIN SELECT RAISE(ABORT, 'the sources of a design are never changed'); END;
CREATE TRIGGER design_source_is_never_removed BEFORE DELETE ON design_source
BEGIN SELECT RAISE(ABORT, 'the sources of a design are never removed'); END;
CREATE TABLE run_metrics (
  run_id INTEGER NOT NULL REFERENCES run,
  version INTEGER NOT NULL,                 -- of the computation
  program TEXT NOT NULL,                    -- its version
  samples INTEGER NOT NULL,                 -- of the run, when they were computed
  reference_us INTEGER NOT NULL,            -- when the outside reference was made that they are measured by; 0: none
  computed_at_us INTEGER NOT NULL,
  document TEXT NOT NULL,                   -- JSON
  PRIMARY KEY (run_id, version)
) WITHOUT ROWID;
CREATE TABLE experiment (
  experiment_id INTEGER PRIMARY KEY,
  robot_id TEXT NOT NULL,
  name TEXT NOT NULL,                       -- of the profile
  profile TEXT NOT NULL,                    -- its document, TOML or JSON
  notes TEXT NOT NULL,
  priority INTEGER NOT NULL,                -- the highest begins first
  unattended INTEGER NOT NULL,              -- 1: it may go on while nobody is there
  state TEXT NOT NULL,                      -- waiting, running, paused, aborting, done, aborted, cancelled, interrupted
  reason TEXT NOT NULL DEFAULT '',          -- why it is paused, held or ended: docs/experiments.md
  detail TEXT NOT NULL DEFAULT '',          -- the same in words
  owner TEXT NOT NULL,                      -- the actor who asked for it
  acts_for TEXT NOT NULL,                   -- the actor in whose name it commands the robot
  held INTEGER NOT NULL DEFAULT 0,          -- 1: it waits until somebody releases it
  needs_rest INTEGER NOT NULL DEFAULT 0,    -- 1: it was interrupted, and its robot was not seen at rest since
  place INTEGER NOT NULL,                   -- in the queue, among those of one priority
  runs_planned INTEGER NOT NULL,
  duration_s REAL NOT NULL,                 -- of all runs
  created_at_us INTEGER NOT NULL,
  started_at_us INTEGER,                    -- NULL: it has not begun
  ended_at_us INTEGER                       -- NULL: it has not ended
);
CREATE INDEX experiment_by_robot ON experiment(robot_id);
CREATE INDEX experiment_not_ended ON experiment(state) WHERE ended_at_us IS NULL;
CREATE INDEX experiment_needs_rest ON experiment(robot_id) WHERE needs_rest = 1;
CREATE TABLE experiment_run (
  experiment_id INTEGER NOT NULL REFERENCES experiment,
  number INTEGER NOT NULL,                  -- from 1, in the order of the profile's grid
  state TEXT NOT NULL,                      -- running, done, aborted, interrupted
  run_id INTEGER,                           -- NULL: it did not come to one
  reason TEXT NOT NULL DEFAULT '',          -- as of the experiment
  variant TEXT NOT NULL,                    -- JSON: fluid, controller, factors, repeat, step
  steps TEXT NOT NULL,                      -- JSON: when each step began, in the time of the robot
  prediction TEXT,                          -- JSON: what the model in use predicted; NULL: nothing
  knowledge TEXT,                           -- JSON: what the fit of the runs up to it knew; NULL: there was none
  started_at_us INTEGER NOT NULL,
  ended_at_us INTEGER,                      -- NULL: it has not ended
  PRIMARY KEY (experiment_id, number)
) WITHOUT ROWID;
CREATE TABLE reservation (
  reservation_id INTEGER PRIMARY KEY,
  robot_id TEXT NOT NULL,
  holder TEXT NOT NULL,                     -- user:NAME, token:NAME or session:NUMBER
  from_us INTEGER NOT NULL,
  until_us INTEGER NOT NULL,                -- the first moment that does not belong to it
  purpose TEXT NOT NULL,
  made_by TEXT NOT NULL,                    -- the actor
  made_at_us INTEGER NOT NULL,
  cancelled_at_us INTEGER,                  -- NULL: it is not
  cancelled_by TEXT NOT NULL DEFAULT ''     -- the actor
);
CREATE TRIGGER reservation_never_overlaps BEFORE INSERT ON reservation
WHEN EXISTS (SELECT 1 FROM reservation WHERE robot_id = NEW.robot_id AND cancelled_at_us IS NULL
  AND from_us < NEW.until_us AND NEW.from_us < until_us)
BEGIN SELECT RAISE(ABORT, 'reservations of one robot never overlap'); END;
CREATE TABLE segment_group (
  boot_key INTEGER NOT NULL REFERENCES boot,
  first_seq INTEGER NOT NULL,      -- of the window
  last_seq INTEGER NOT NULL,
  samples INTEGER NOT NULL,        -- that are stored in it
  first_utc_us INTEGER NOT NULL,   -- of the first of them
  last_utc_us INTEGER NOT NULL,
  extremes BLOB NOT NULL,          -- least and largest value of each channel, binary32, little-endian: docs/database.md
  PRIMARY KEY (boot_key, first_seq)
) WITHOUT ROWID;
CREATE TRIGGER segment_group_goes_with_a_segment AFTER DELETE ON segment
BEGIN DELETE FROM segment_group WHERE boot_key = OLD.boot_key AND last_seq >= OLD.first_seq
  AND first_seq = (SELECT max(first_seq) FROM segment_group
                   WHERE boot_key = OLD.boot_key AND first_seq <= OLD.first_seq); END;
CREATE INDEX event_by_time ON event(robot_id, received_at_us);
CREATE INDEX command_renewed ON command(command_id) WHERE further_renewals IS NULL;
CREATE VIEW robot_command AS
SELECT printf('%llu', command_id) AS command_id, robot_id, printf('%llu', boot_id) AS boot_id, kind, arguments, actor,
  state, reason, submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us,
  printf('%llu', emergency_id) AS emergency_id, sent_after_us, acknowledged_after_us, verified_after_us, life_from,
  further_renewals, last_renewed_at_us
FROM command;
CREATE INDEX run_span_by_boot ON run_span(boot_key);
CREATE INDEX run_by_robot ON run(robot_id, started_at_us);
CREATE INDEX command_stop ON command(boot_id, effect_at_robot_us) WHERE kind = 'emergency_stop';
CREATE TABLE rest_owed (              -- robots that move in a name whose right has ended, and were not seen at rest since
  robot_id TEXT PRIMARY KEY REFERENCES robot,
  boot_id INTEGER NOT NULL,           -- that moves so; a later one is at rest
  why TEXT NOT NULL,                  -- what has ended the right
  since_us INTEGER NOT NULL
) WITHOUT ROWID;
CREATE INDEX event_of_interruption ON event(boot_key, robot_time_us) WHERE kind = 'experiment_interrupted';
CREATE TABLE run_origin (               -- runs of experiments; stays when the experiment is forgotten
  run_id INTEGER PRIMARY KEY REFERENCES run,
  experiment_id INTEGER NOT NULL,
  number INTEGER NOT NULL,              -- of the run in its experiment, from 1
  variant TEXT NOT NULL,                -- JSON: fluid, controller, factors, repeat, step
  profile_sha256 TEXT,                  -- of profile; NULL: it has not been computed
  profile TEXT NOT NULL                 -- the document that was performed, TOML or JSON
);
CREATE TABLE design_sent (              -- controllers of designs that a robot was to be sent; a run has its checksum
  design_id INTEGER NOT NULL REFERENCES design,
  robot_id TEXT NOT NULL,
  controller_checksum INTEGER NOT NULL,
  first_at_us INTEGER NOT NULL,         -- when it was to be sent for the first time
  PRIMARY KEY (design_id, robot_id, controller_checksum)
) WITHOUT ROWID;
CREATE INDEX design_sent_by_robot ON design_sent(robot_id, controller_checksum);
CREATE INDEX design_by_model ON design(model_id);
