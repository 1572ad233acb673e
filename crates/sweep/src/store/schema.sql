-- Store of one campaign, schema 1. Strains, not times; lengths in a, stresses in mu·rate.

CREATE TABLE campaign (
    id       INTEGER PRIMARY KEY CHECK (id = 1),
    name     TEXT NOT NULL,
    text     TEXT NOT NULL,     -- the campaign file last run, to the letter
    protocol TEXT NOT NULL      -- JSON
);

-- One row for every process that ever worked on this store.
CREATE TABLE processes (
    id              INTEGER PRIMARY KEY,
    host            TEXT NOT NULL,
    boot            TEXT NOT NULL,      -- boot of the host: changes when it restarts
    namespace       TEXT NOT NULL,      -- where its pid has meaning
    pid             INTEGER NOT NULL,
    start           TEXT NOT NULL,      -- start of the process in clock ticks: tells a reused pid
    started_at      INTEGER NOT NULL,   -- milliseconds since 1970, as all times here
    heartbeat       INTEGER NOT NULL,
    ended_at        INTEGER,
    version         TEXT NOT NULL,      -- of the program
    physics_version INTEGER NOT NULL,
    build           TEXT NOT NULL,      -- hash of the executable: bits repeat on the same build
    threads         INTEGER NOT NULL
);

CREATE TABLE cases (
    id             INTEGER PRIMARY KEY,
    key            TEXT NOT NULL UNIQUE,
    position       INTEGER,             -- in the campaign file; NULL once the case has left the grid
    rank           INTEGER NOT NULL,    -- order of work
    params         TEXT NOT NULL,       -- JSON
    seed           INTEGER NOT NULL,
    steps          INTEGER NOT NULL,
    sample_stride  INTEGER NOT NULL,
    cost           REAL NOT NULL,       -- estimated, for shares of a bar
    state          TEXT NOT NULL DEFAULT 'pending'
                   CHECK (state IN ('pending', 'running', 'done', 'jammed', 'failed')),
    owner          INTEGER REFERENCES processes (id),
    steps_done     INTEGER NOT NULL DEFAULT 0,  -- as of the last checkpoint
    attempts       INTEGER NOT NULL DEFAULT 0,  -- times it was claimed
    changed_at     INTEGER NOT NULL,
    CHECK ((state = 'running') = (owner IS NOT NULL))
);
CREATE INDEX cases_to_do ON cases (state, rank);
CREATE INDEX cases_begun ON cases (rank) WHERE state = 'pending' AND steps_done > 0;

CREATE TABLE checkpoints (
    case_id    INTEGER NOT NULL REFERENCES cases (id),
    generation INTEGER NOT NULL,        -- 0 or 1: the last two are kept
    steps      INTEGER NOT NULL,
    process    INTEGER NOT NULL REFERENCES processes (id),
    written_at INTEGER NOT NULL,
    data       BLOB NOT NULL,           -- magic, version, checksum, content
    PRIMARY KEY (case_id, generation)
);

-- Rows, not blobs: as compact here (about 150 bytes), and any SQLite client reads them.
CREATE TABLE samples (
    case_id                  INTEGER NOT NULL REFERENCES cases (id),
    step                     INTEGER NOT NULL,
    strain                   REAL NOT NULL,
    viscosity                REAL,
    viscosity_stresslet      REAL,
    normal_stress_difference REAL,
    dissipation              REAL,
    contacts                 INTEGER NOT NULL,
    activated                INTEGER NOT NULL,
    rolling                  INTEGER NOT NULL,
    slipping                 INTEGER NOT NULL,
    normal_velocity          REAL,
    minimum_gap              REAL,
    stages                   INTEGER NOT NULL,
    unconverged_stages       INTEGER NOT NULL,
    worst_residual           REAL,
    worst_friction_error     REAL,
    minimum_gap_so_far       REAL,
    jam_events               INTEGER NOT NULL,
    jammed_steps             INTEGER NOT NULL,
    jammed_steps_running     INTEGER NOT NULL,
    PRIMARY KEY (case_id, step)
) WITHOUT ROWID;

-- One row for every done or jammed case. Means over the samples from discard_step on; NULL without such samples.
CREATE TABLE results (
    case_id                      INTEGER PRIMARY KEY REFERENCES cases (id),
    discard_step                 INTEGER NOT NULL,
    samples                      INTEGER NOT NULL,
    viscosity                    REAL,
    viscosity_quartile_1         REAL,
    viscosity_median             REAL,
    viscosity_quartile_3         REAL,
    viscosity_stresslet          REAL,
    viscosity_stresslet_quartile_1 REAL,
    viscosity_stresslet_median   REAL,
    viscosity_stresslet_quartile_3 REAL,
    normal_stress_difference     REAL,
    dissipation                  REAL,
    contacts_per_sphere          REAL,
    activated_fraction           REAL,     -- activated / contacts
    rolling_fraction             REAL,     -- rolling / activated
    mean_approach_velocity       REAL,     -- over all contacts of all samples, positive for approach
    contacts                     INTEGER NOT NULL,   -- sums over the samples, for averages over runs
    activated                    INTEGER NOT NULL,
    rolling                      INTEGER NOT NULL,
    approach                     REAL NOT NULL,
    minimum_gap                  REAL,     -- of all stages of the run, discarded strain included, as are those below
    stages                       INTEGER NOT NULL,
    unconverged_stages           INTEGER NOT NULL,
    worst_residual               REAL,
    worst_friction_error         REAL,
    jam_events                   INTEGER NOT NULL,
    jammed_strain                REAL NOT NULL,
    final_strain                 REAL NOT NULL,
    wall_time_s                  REAL NOT NULL,
    resumed                      INTEGER NOT NULL,   -- times it went on from a checkpoint
    process                      INTEGER NOT NULL REFERENCES processes (id),
    finished_at                  INTEGER NOT NULL
);

-- Every failed attempt, kept after a retry.
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
    snapshot  TEXT,                 -- JSON, state before the step that failed
    process   INTEGER NOT NULL REFERENCES processes (id),
    failed_at INTEGER NOT NULL
);
CREATE INDEX failures_of_case ON failures (case_id);
