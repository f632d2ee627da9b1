-- The eighth migration: jobs, models and controllers that are kept, metrics of runs, experiments, reservations.
--
-- It adds tables only: no row is rewritten.

-- Computations that somebody asked the station for. Of those that have ended the newest 1000 are kept.
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

-- A model or a controller that somebody keeps. Rows are added, and never changed or removed: a change is a new row with a
-- parent.
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

-- The runs that a design was found from; a run may be discarded later.
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

-- The metrics of a run as they were computed; replaced when the run has another reference, or more samples.
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

-- Experiments: profiles that robots are to perform, in the queue of each robot. Of those that have ended the newest 10000
-- are kept.
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

-- The runs of an experiment that have begun.
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

-- Reservations of robots: time slots in which one account may command one. Of those that are over or cancelled the
-- newest 10000 are kept.
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
