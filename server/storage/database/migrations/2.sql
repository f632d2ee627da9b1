-- The second migration: what runs, clocks, certificates and retention need beside the samples themselves.
--
-- It adds columns and tables only, so it takes as long as the database has boots and runs: no sample is rewritten.

-- Everything below these is stored, lost or purged; 0: not known, the segments and gaps tell.
ALTER TABLE boot ADD COLUMN durable_next_seq INTEGER NOT NULL DEFAULT 0;
ALTER TABLE boot ADD COLUMN durable_next_event_seq INTEGER NOT NULL DEFAULT 0;

-- UTC when the first sample of the segment had arrived; 0 in segments of version 1: as received_at_us.
ALTER TABLE segment ADD COLUMN first_received_at_us INTEGER NOT NULL DEFAULT 0;

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

ALTER TABLE run ADD COLUMN state TEXT NOT NULL DEFAULT 'open';  -- open, ended, interrupted, discarded
ALTER TABLE run ADD COLUMN made_afterwards INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN made_by TEXT NOT NULL DEFAULT '';    -- the actor
ALTER TABLE run ADD COLUMN profile TEXT NOT NULL DEFAULT '';    -- of the experiment; pump_profile is the pump's
UPDATE run SET state = 'ended' WHERE ended_at_us IS NOT NULL;

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
);

-- As before, with two columns more. CROSS JOIN fixes the order: span, its segments by index, their rows by number. A
-- segment that holds a span's first sample begins at most 99 before it.
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
  segment.flags & 1 AS backfilled
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

-- What was in force when a span began, and what came into force within it.
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
