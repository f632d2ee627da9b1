-- The twelfth migration: how many ticks of a run the robot missed.
--
-- It adds two columns: no row is rewritten. A digest of an older version has NULL there until the station has counted
-- them from the heads of its segments; what a digest hashes stays.
ALTER TABLE run_certificate ADD COLUMN missed_ticks INTEGER;          -- at which the robot made no sample; NULL: not counted
ALTER TABLE run_certificate ADD COLUMN longest_missed_ticks INTEGER;  -- in a row
