-- What schema 3 adds to schema 2: campaigns spread over the tasks of an engine such as Slurm, and shards merged.

-- The task a process worked for; NULL for one that was started by hand on the store itself.
ALTER TABLE processes ADD COLUMN job TEXT;
ALTER TABLE processes ADD COLUMN task INTEGER;
ALTER TABLE processes ADD COLUMN restart INTEGER;
ALTER TABLE processes ADD COLUMN node TEXT;

-- One row for every job that was handed to an engine.
CREATE TABLE submissions (
    id           INTEGER PRIMARY KEY,
    engine       TEXT NOT NULL,
    job          TEXT,              -- its name for the engine; NULL until the engine has answered
    plan         TEXT NOT NULL,     -- hash of its slices
    folder       TEXT NOT NULL,     -- where its tasks publish their shards
    tasks        INTEGER NOT NULL,
    workers      INTEGER NOT NULL,  -- per task
    build        TEXT NOT NULL,     -- hash of the executable it runs
    submitted_at INTEGER NOT NULL,
    cancelled_at INTEGER
);

-- Which task of a job was given which case.
CREATE TABLE slices (
    submission INTEGER NOT NULL REFERENCES submissions (id),
    case_id    INTEGER NOT NULL REFERENCES cases (id),
    task       INTEGER NOT NULL,
    PRIMARY KEY (submission, case_id)
) WITHOUT ROWID;

-- Shards merged, each as it was then: one that has not changed since is not read again.
CREATE TABLE shards (
    name      TEXT PRIMARY KEY,
    size      INTEGER NOT NULL,
    modified  INTEGER NOT NULL,     -- nanoseconds since 1970
    builds    TEXT NOT NULL,        -- JSON: hashes of the executables that computed it
    mixed     INTEGER NOT NULL,     -- whether it was let in although its build was another than the store's
    merged_at INTEGER NOT NULL
);

-- Results of one case that are not the same to the last bit, which no two attempts should give.
CREATE TABLE disagreements (
    case_id  INTEGER NOT NULL REFERENCES cases (id),
    kept     INTEGER NOT NULL REFERENCES processes (id),
    other    INTEGER NOT NULL REFERENCES processes (id),
    what     TEXT NOT NULL,
    found_at INTEGER NOT NULL,
    PRIMARY KEY (case_id, kept, other)
) WITHOUT ROWID;
