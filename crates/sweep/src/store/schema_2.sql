-- What schema 2 adds to schema 1: frames of runs, and a count of deaths.

-- Times in a row the process of a case died without a new checkpoint.
ALTER TABLE cases ADD COLUMN deaths INTEGER NOT NULL DEFAULT 0;

-- Layers at the sampled strains, where a run was asked to keep them.
CREATE TABLE frames (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    step    INTEGER NOT NULL,
    strain  REAL NOT NULL,
    data    BLOB NOT NULL,              -- version, then content
    PRIMARY KEY (case_id, step)
) WITHOUT ROWID;
