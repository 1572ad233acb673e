-- What schema 5 adds to schema 4: runs that are longer or shorter than the campaign asks for, and who asks for what.

-- Where the campaign file last run was, and a hash of what it asks for.
ALTER TABLE campaign ADD COLUMN file TEXT NOT NULL DEFAULT '';
ALTER TABLE campaign ADD COLUMN asks TEXT NOT NULL DEFAULT '';
-- The same of the process: two that ask for different runs do not work on one store at once. NULL until it begins to compute.
ALTER TABLE processes ADD COLUMN file TEXT;
ALTER TABLE processes ADD COLUMN asks TEXT;

-- How far each finished run was computed. The campaign may ask for less: then its result is that of the beginning of the run.
-- It may ask for more: then the run goes on from here.
CREATE TABLE ends (
    case_id              INTEGER PRIMARY KEY REFERENCES cases (id),
    steps                INTEGER NOT NULL,
    jammed               INTEGER NOT NULL,  -- whether the layer jammed there, so that there is nothing to go on with
    minimum_gap          REAL,              -- counters of all these steps, as in results
    stages               INTEGER NOT NULL,
    unconverged_stages   INTEGER NOT NULL,
    worst_residual       REAL,
    worst_friction_error REAL,
    jam_events           INTEGER NOT NULL,
    jammed_steps         INTEGER NOT NULL,
    state                BLOB               -- a checkpoint without samples; NULL in runs finished under schema 4 or before
);

-- With row numbers: rows of some thousand bytes fill the pages of such a table, and left most of them empty without.
CREATE TABLE frames_by_row (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    step    INTEGER NOT NULL,
    strain  REAL NOT NULL,
    data    BLOB NOT NULL,                  -- version, then content
    PRIMARY KEY (case_id, step)
);
INSERT INTO frames_by_row SELECT case_id, step, strain, data FROM frames ORDER BY case_id, step;
DROP TABLE frames;
ALTER TABLE frames_by_row RENAME TO frames;
