-- The store of one campaign. Strains, not times; lengths in a, stresses in mu·rate; moments in milliseconds since 1970.
-- A digest is the first 64 bits of a BLAKE3 hash of values with the names of their columns; NULL adds nothing to it.

CREATE TABLE campaign (
    id       INTEGER PRIMARY KEY CHECK (id = 1),
    name     TEXT NOT NULL,
    text     TEXT NOT NULL,         -- the campaign file last run, to the letter
    entered  TEXT NOT NULL,         -- JSON: what it requests of its runs
    written  TEXT NOT NULL,         -- JSON: points that share runs, names of start layers
    digest   INTEGER NOT NULL       -- of all above
);

-- One row for every process that ever worked on this store.
CREATE TABLE processes (
    id              INTEGER PRIMARY KEY,
    host            TEXT NOT NULL,
    boot            TEXT NOT NULL,      -- boot of the host: changes when it restarts
    namespace       TEXT NOT NULL,      -- where its pid has meaning
    pid             INTEGER NOT NULL,
    start           TEXT NOT NULL,      -- start of the process in clock ticks: distinguishes a reused pid
    started_at      INTEGER NOT NULL,
    version         TEXT NOT NULL,      -- of the program
    physics_version INTEGER NOT NULL,
    build           TEXT NOT NULL,      -- hash of the executable: bits repeat on the same build
    threads         INTEGER NOT NULL,
    job             TEXT,               -- the task of a scheduler that it worked for
    task            INTEGER,
    restart         INTEGER,
    node            TEXT,
    digest          INTEGER NOT NULL,   -- of all above
    heartbeat       INTEGER NOT NULL,
    ended_at        INTEGER,
    file            TEXT,               -- the campaign file that it computes,
    request         TEXT                -- and what that requests
);

-- The parameters of runs that differ only in their seed: as the program reads them, and axis by axis for the view `axes`.
CREATE TABLE points (
    id     INTEGER PRIMARY KEY,
    params TEXT NOT NULL,           -- JSON
    axes   TEXT NOT NULL,           -- JSON
    digest INTEGER NOT NULL UNIQUE  -- of params and axes
);

CREATE TABLE cases (
    id             INTEGER PRIMARY KEY,
    key            TEXT NOT NULL UNIQUE,
    point          INTEGER NOT NULL REFERENCES points (id),
    seed           INTEGER NOT NULL,
    steps          INTEGER NOT NULL,
    sample_stride  INTEGER NOT NULL,
    position       INTEGER,             -- in the campaign file; NULL once the case has left the grid
    rule           INTEGER,             -- the precision that decides on its seed, by its number in the campaign
    counts         INTEGER NOT NULL,    -- 0 outside the grid, and for seeds that a precision has not requested yet
    turn           INTEGER NOT NULL,    -- order of work: cases with a low number come first
    gain           REAL NOT NULL DEFAULT 0.0,   -- among equal turns: the highest gain first
    cost           REAL NOT NULL,       -- estimated seconds of CPU
    state          TEXT NOT NULL DEFAULT 'pending'
                   CHECK (state IN ('pending', 'running', 'done', 'jammed', 'failed')),
    owner          INTEGER REFERENCES processes (id),
    steps_done     INTEGER NOT NULL DEFAULT 0,  -- as of the last checkpoint
    attempts       INTEGER NOT NULL DEFAULT 0,  -- times it was claimed
    deaths         INTEGER NOT NULL DEFAULT 0,  -- times in a row its process died without a new checkpoint
    changed_at     INTEGER NOT NULL,
    samples_digest INTEGER,             -- of its last sample and this digest before it; NULL without any
    frames_from    INTEGER,             -- it has a frame of each sampled step from this one; NULL if it keeps none
    frames_until   INTEGER,             -- until this one
    digest         INTEGER,             -- of key, state, steps, samples, result and failures; NULL as long as it never ended
    CHECK ((state = 'running') = (owner IS NOT NULL))
);
CREATE INDEX IF NOT EXISTS queue ON cases (turn, gain DESC, position) WHERE state = 'pending' AND counts;
CREATE INDEX IF NOT EXISTS running ON cases (owner) WHERE state = 'running';
CREATE INDEX IF NOT EXISTS orphans ON cases (state) WHERE NOT counts;
CREATE INDEX IF NOT EXISTS cases_of_point ON cases (point);
CREATE INDEX IF NOT EXISTS cases_of_rule ON cases (rule, position) WHERE rule IS NOT NULL;

CREATE TABLE checkpoints (
    case_id    INTEGER NOT NULL REFERENCES cases (id),
    generation INTEGER NOT NULL,        -- 0 or 1: the last two are kept; 2: the last state of a completed run
    steps      INTEGER NOT NULL,
    process    INTEGER NOT NULL REFERENCES processes (id),
    written_at INTEGER NOT NULL,
    data       BLOB NOT NULL,           -- magic, version, checksum, content
    PRIMARY KEY (case_id, generation)
);

-- Rows, not blobs: as compact here (about 600 bytes), and any SQLite client reads them.
CREATE TABLE samples (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    step    INTEGER NOT NULL,
    {samples},
    PRIMARY KEY (case_id, step)
) WITHOUT ROWID;

-- One row for every completed run. The campaign may request less of it than was computed: then the averages are those of
-- the beginning of the run. It may request more: then the run is pending, and goes on from its last state.
CREATE TABLE results (
    case_id  INTEGER PRIMARY KEY REFERENCES cases (id),
    {results},
    process  INTEGER NOT NULL REFERENCES processes (id),
    doubts   TEXT NOT NULL,         -- names of the rules it broke, as doubt.rs has them
    computed INTEGER NOT NULL,      -- steps
    jammed   INTEGER NOT NULL,      -- whether the layer jammed there, so that there is nothing to go on with
    counters TEXT NOT NULL          -- JSON: those of all these steps
);

-- Every failed attempt.
CREATE TABLE failures (
    id        INTEGER PRIMARY KEY,
    case_id   INTEGER NOT NULL REFERENCES cases (id),
    attempt   INTEGER NOT NULL,
    error     TEXT NOT NULL,
    step      INTEGER NOT NULL,
    strain    REAL NOT NULL,
    sphere_i  INTEGER,
    sphere_j  INTEGER,
    gap       REAL,
    snapshot  TEXT,                     -- JSON, state before the step that failed
    process   INTEGER NOT NULL REFERENCES processes (id),
    failed_at INTEGER NOT NULL,
    retried   INTEGER NOT NULL DEFAULT 0    -- whether the case was made pending again after it
);
CREATE INDEX IF NOT EXISTS failures_of_case ON failures (case_id);

-- Layers at the sampled strains, where a run was asked to keep them.
CREATE TABLE frames (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    step    INTEGER NOT NULL,
    strain  REAL NOT NULL,
    data    BLOB NOT NULL,              -- version, then content
    digest  INTEGER NOT NULL,           -- of step, strain, data, and the key of the case
    PRIMARY KEY (case_id, step)
);

-- One row for every job that was handed to a scheduler.
CREATE TABLE submissions (
    id           INTEGER PRIMARY KEY,
    engine       TEXT NOT NULL,         -- the scheduler: slurm
    job          TEXT,                  -- its name for the scheduler; NULL until the scheduler has answered
    plan         TEXT NOT NULL,         -- hash of its slices
    folder       TEXT NOT NULL,         -- where its tasks publish their shards
    tasks        INTEGER NOT NULL,
    workers      INTEGER NOT NULL,      -- per task
    build        TEXT NOT NULL,         -- hash of the executable it runs
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
