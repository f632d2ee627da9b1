-- The ninth migration: a second level of extremes, for overviews of days and months; events by their time.
--
-- It adds a table, a column and an index; the station makes the rows in the background
-- (server/storage/groups/segment_groups.hpp).

-- The extremes of all segments of a boot in a window of 6400 numbers in which every sample is stored or lost. Everything
-- in it follows from the segments; rows may be missing.
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

-- Windows below this are made, or nothing of them is stored.
ALTER TABLE boot ADD COLUMN grouped_next_seq INTEGER NOT NULL DEFAULT 0;

-- A group is of all segments in its window: it goes with the first of them that is removed.
CREATE TRIGGER segment_group_goes_with_a_segment AFTER DELETE ON segment
BEGIN DELETE FROM segment_group WHERE boot_key = OLD.boot_key AND last_seq >= OLD.first_seq
  AND first_seq = (SELECT max(first_seq) FROM segment_group
                   WHERE boot_key = OLD.boot_key AND first_seq <= OLD.first_seq); END;

-- Events of a window of time are found without reading all of the robot.
CREATE INDEX event_by_time ON event(robot_id, received_at_us);
DROP INDEX event_by_robot;
