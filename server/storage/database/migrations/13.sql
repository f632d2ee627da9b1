-- The thirteenth migration: which models of fluids are in doubt. It adds a column, and rewrites no row.
ALTER TABLE fluid_model ADD COLUMN assumed_because TEXT NOT NULL DEFAULT '';  -- the grave doubts: robots are sent it as assumed
