-- A store of schema 4: two finished runs of old.toml, of physics 3.
PRAGMA application_id = 1398228304;
PRAGMA user_version = 4;
BEGIN TRANSACTION;
CREATE TABLE campaign (
    id       INTEGER PRIMARY KEY CHECK (id = 1),
    name     TEXT NOT NULL,
    text     TEXT NOT NULL,     -- the campaign file last run, to the letter
    protocol TEXT NOT NULL      -- JSON
);
INSERT INTO "campaign" VALUES(1,'old','name = "old"
[protocol]
strain = 0.3
discard = 0.1
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.68
friction = 0.3
roughness = 0.01
shear_rate = [0.1, inf]
seeds = 1
spheres = 16
hydrodynamics = "ball-melrose"
','{"time_step":0.005,"strain":0.3,"discard":0.1,"checkpoint_every":0.02,"sample_every":0.02}');
CREATE TABLE cases (
    id             INTEGER PRIMARY KEY,
    key            TEXT NOT NULL UNIQUE,
    position       INTEGER,             -- in the campaign file; NULL once the case has left the grid
    rank           INTEGER NOT NULL,    -- order of work
    params         TEXT NOT NULL,       -- JSON
    seed           INTEGER NOT NULL,
    steps          INTEGER NOT NULL,
    sample_stride  INTEGER NOT NULL,
    time_step      REAL NOT NULL,
    area_fraction  REAL NOT NULL,
    friction       REAL NOT NULL,
    roughness      REAL NOT NULL,
    shear_rate     REAL NOT NULL,       -- may be infinite
    spheres        INTEGER NOT NULL,
    size_ratio     REAL NOT NULL,
    large_fraction REAL NOT NULL,
    hydrodynamics  TEXT NOT NULL,
    contact        TEXT NOT NULL,
    cost           REAL NOT NULL,       -- estimated, for shares of a bar
    state          TEXT NOT NULL DEFAULT 'pending'
                   CHECK (state IN ('pending', 'running', 'done', 'jammed', 'failed')),
    owner          INTEGER REFERENCES processes (id),
    steps_done     INTEGER NOT NULL DEFAULT 0,  -- as of the last checkpoint
    attempts       INTEGER NOT NULL DEFAULT 0,  -- times it was claimed
    changed_at     INTEGER NOT NULL,
    deaths         INTEGER NOT NULL DEFAULT 0, tangential TEXT NOT NULL DEFAULT 'roll-slip', friction_onset TEXT NOT NULL DEFAULT 'critical-load', stiffness REAL NOT NULL DEFAULT 9e999, tangential_stiffness REAL NOT NULL DEFAULT 0.0, dashpot REAL NOT NULL DEFAULT 0.0, lubrication_gap REAL NOT NULL DEFAULT 0.0, repulsion REAL NOT NULL DEFAULT 0.0, repulsion_length REAL NOT NULL DEFAULT 0.0,  -- times in a row its process died without a new checkpoint
    CHECK ((state = 'running') = (owner IS NOT NULL))
);
INSERT INTO "cases" VALUES(1,'aa20d1d598efa7a213080297cf0f8a00',0,0,'{"spheres":16,"area_fraction":0.68,"roughness":0.01,"friction":0.3,"shear_rate":0.1,"size_ratio":1.0,"large_fraction":0.5,"hydrodynamics":"ball-melrose","contact":"rigid","time_step":0.005}',1,60,4,0.005,0.68,0.3,0.01,0.1,16,1.0,0.5,'ball-melrose','rigid',0.0319488,'done',NULL,60,1,0,0,'roll-slip','critical-load',9e999,0.0,0.0,0.0,0.0,0.0);
INSERT INTO "cases" VALUES(2,'609561ce1a78b466a390edc7ce1f80ee',1,1,'{"spheres":16,"area_fraction":0.68,"roughness":0.01,"friction":0.3,"shear_rate":"inf","size_ratio":1.0,"large_fraction":0.5,"hydrodynamics":"ball-melrose","contact":"rigid","time_step":0.005}',1,60,4,0.005,0.68,0.3,0.01,9e999,16,1.0,0.5,'ball-melrose','rigid',0.0319488,'done',NULL,60,1,0,0,'roll-slip','critical-load',9e999,0.0,0.0,0.0,0.0,0.0);
CREATE TABLE checkpoints (
    case_id    INTEGER NOT NULL REFERENCES cases (id),
    generation INTEGER NOT NULL,        -- 0 or 1: the last two are kept
    steps      INTEGER NOT NULL,
    process    INTEGER NOT NULL REFERENCES processes (id),
    written_at INTEGER NOT NULL,
    data       BLOB NOT NULL,           -- magic, version, checksum, content
    PRIMARY KEY (case_id, generation)
);
CREATE TABLE disagreements (
    case_id  INTEGER NOT NULL REFERENCES cases (id),
    kept     INTEGER NOT NULL REFERENCES processes (id),
    other    INTEGER NOT NULL REFERENCES processes (id),
    what     TEXT NOT NULL,
    found_at INTEGER NOT NULL,
    PRIMARY KEY (case_id, kept, other)
) WITHOUT ROWID;
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
CREATE TABLE frames (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    step    INTEGER NOT NULL,
    strain  REAL NOT NULL,
    data    BLOB NOT NULL,              -- version, then content
    PRIMARY KEY (case_id, step)
) WITHOUT ROWID;
INSERT INTO "frames" VALUES(1,0,0.0,X'0100000000000000000890094100000000010000803F10846430400142503F00000000CE973F426041F3C1F2C368426B52D240D820134000000000B95D5A41905A45C2152C9842D103FA3F9B6AD34000000000A8C66B4159E9EBC177AD5A4278989940DEE1943F00000000D08C0E420EADB4C142484D4203BAD140DFE0AF40000000007506C14131DC4A41469D51420B528F40EBE0B64000000000545652422B398FC23D2F894290CCA03F6AC45140000000006F245E41B36A76417C599742D4465D4015DE304000000000C9272141481D05C220B667429963FE409934E14000000000A239C84192AD7CC1CEA1B042B16DE2401EF49D3E000000002DEED941C1DE36C21AEC7B4220F72D40F431954000000000ACDE1442CE9700C26C43B6426B9577400C0CF64000000000EDC37F41A4201DC24D8D40421B021A3DB9A1D33F00000000A013FA4040D85141C2F88B42DA44A7405FDD7540000000000B186D414F3A2AC2EC63C34209CF773F16CC05410000000092FEFE41F88EA7C17A19A04287C2CF3E8135A64000000000EC26D140B8E695C12D3C254200');
INSERT INTO "frames" VALUES(2,0,0.0,X'0100000000000000000890094100000000010000803F10846430400142503F00000000CE973F426041F3C1F2C368426B52D240D820134000000000B95D5A41905A45C2152C9842D103FA3F9B6AD34000000000A8C66B4159E9EBC177AD5A4278989940DEE1943F00000000D08C0E420EADB4C142484D4203BAD140DFE0AF40000000007506C14131DC4A41469D51420B528F40EBE0B64000000000545652422B398FC23D2F894290CCA03F6AC45140000000006F245E41B36A76417C599742D4465D4015DE304000000000C9272141481D05C220B667429963FE409934E14000000000A239C84192AD7CC1CEA1B042B16DE2401EF49D3E000000002DEED941C1DE36C21AEC7B4220F72D40F431954000000000ACDE1442CE9700C26C43B6426B9577400C0CF64000000000EDC37F41A4201DC24D8D40421B021A3DB9A1D33F00000000A013FA4040D85141C2F88B42DA44A7405FDD7540000000000B186D414F3A2AC2EC63C34209CF773F16CC05410000000092FEFE41F88EA7C17A19A04287C2CF3E8135A64000000000EC26D140B8E695C12D3C254200');
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
, job TEXT, task INTEGER, restart INTEGER, node TEXT);
INSERT INTO "processes" VALUES(1,'a-host','','',1,'1',0,0,0,'0.1.0',3,'0123456789abcdef',1,NULL,NULL,NULL,NULL);
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
INSERT INTO "results" VALUES(1,20,10,7.81691955249240333358e+00,7.36133924378765680529e+00,7.83103180122692332787e+00,8.38390120549496,4.72212178794920145463e+00,3.95591596439756898462e+00,4.43024834260836186672e+00,5.22161031251960316978e+00,9.8963825307799,6.80231473526845586974e+00,0.64375,0.0,NULL,0.00671044540593248,103,0,0,6.91175876811045419856e-01,9.98601920742325788182e-03,240,0,1.81676017201793768198e-16,0.0,0,0.0,0.3,0.01,0,1,0);
INSERT INTO "results" VALUES(2,20,10,1.07212032914019648186e+01,9.61426784059750438871e+00,9.95779007024489,1.18805623405217080095e+01,4.64907332884642610082e+00,4.05573525323318939683e+00,4.50800686889448076755e+00,5.20464014601721824959e+00,1.88069201451406442515e+01,9.51835894193875731161e+00,0.6375,1.0,9.70588235294117640528e-01,2.67261239097474519177e-03,102,102,99,0.272606463879424,9.97243478021170304259e-03,240,0,4.20563418988001159462e-16,0.0,0,0.0,0.3,0.01,0,1,0);
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
INSERT INTO "samples" VALUES(1,0,0.0,8.26781790939016758557e+00,8.26781790939016758557e+00,5.34225669777757605771e+00,7.26781790939016669739e+00,0,0,0,0,0.0,1.3130226768964803341e-02,1,0,0.0,0.0,1.3130226768964803341e-02,0,0,0);
INSERT INTO "samples" VALUES(1,4,0.02,8.16353462115998596004e+00,8.16353462115998596004e+00,5.90002384243140554076e+00,7.16353462115998507186e+00,0,0,0,0,0.0,1.10633016444752207974e-02,17,0,0.0,0.0,1.10633016444752207974e-02,0,0,0);
INSERT INTO "samples" VALUES(1,8,0.04,8.27223057579838183528e+00,7.59507347041200286952e+00,6.80071087423453324305e+00,7.27021875655924354475e+00,2,0,0,0,-1.82109333839136633415e-03,1.00044256058859915015e-02,33,0,4.26246947198350960728e-17,0.0,1.00044256058859915015e-02,0,0,0);
INSERT INTO "samples" VALUES(1,12,0.06,8.27680222787557440256e+00,7.55938663966896573498e+00,7.49577545884909479667e+00,7.27691699841352157562e+00,2,0,0,0,1.08988150873123856854e-04,9.99717216320572532595e-03,49,0,7.00747776459971505064e-17,0.0,9.99717216320572532595e-03,0,0,0);
INSERT INTO "samples" VALUES(1,16,0.08,8.46048424304292367992e+00,6.91901381979604046534e+00,8.48503780580008282186e+00,7.44519756154735112829e+00,3,0,0,0,-6.50189562514584106639e-03,9.99634462899967601856e-03,65,0,7.00747776459971505064e-17,0.0,9.99634462899967601856e-03,0,0,0);
INSERT INTO "samples" VALUES(1,20,0.1,8.58569713221858,6.41509725855811,9.43702974512677528196e+00,7.56436030959220762071e+00,5,0,0,0,-1.16620273257019620855e-02,9.99543393179447292595e-03,81,0,1.00646013201030016192e-16,0.0,9.99543393179447292595e-03,0,0,0);
INSERT INTO "samples" VALUES(1,24,0.12,8.49535668552149303422e+00,6.06560804101551465095e+00,9.88226165402688394578e+00,7.44931218440965814409e+00,7,0,0,0,-4.45387718909940957812e-02,0.00999460408854036,97,0,1.04690496262495793947e-16,0.0,0.00999460408854036,0,0,0);
INSERT INTO "samples" VALUES(1,28,0.14,8.43656601373145,5.32976570351276,1.04650322866625717917e+01,7.43474551054040500019e+00,8,0,0,0,-5.79485696097968572271e-04,9.99233044560687844182e-03,113,0,1.46174836481142835856e-16,0.0,9.99233044560687844182e-03,0,0,0);
INSERT INTO "samples" VALUES(1,32,0.16,8.22590678078548620533e+00,4.89714413954013139118e+00,1.04418372579694231918e+01,7.19157959615690689503e+00,9,0,0,0,-6.90243472190702530427e-03,9.99018610377522264798e-03,129,0,1.59942974881318488366e-16,0.0,9.99018610377522264798e-03,0,0,0);
INSERT INTO "samples" VALUES(1,36,0.18,7.94164946908415281257e+00,4.64631647787103574387e+00,1.02315684887057969378e+01,6.92887021438200534362e+00,10,0,0,0,-6.84738926594781298351e-03,9.98994313853351911802e-03,145,0,1.59942974881318488366e-16,0.0,9.98994313853351911802e-03,0,0,0);
INSERT INTO "samples" VALUES(1,40,0.2,7.72041413336969384317e+00,4.21418020734568887775e+00,1.01055883453223547261e+01,6.6962021356687850826e+00,12,0,0,0,-1.38922931474299987675e-02,9.98977845379256379487e-03,161,0,1.59942974881318488366e-16,0.0,9.98977845379256379487e-03,0,0,0);
INSERT INTO "samples" VALUES(1,44,0.22,7.52358190646366598031e+00,3.97385639461037776243e+00,9.99933946813594864977e+00,6.52481217290137305298e+00,12,0,0,0,1.72113802105152910448e-04,9.98947209471889863152e-03,177,0,1.81676017201793768198e-16,0.0,9.98947209471889863152e-03,0,0,0);
INSERT INTO "samples" VALUES(1,48,0.24,7.30725835622898678423e+00,3.90018068107490689655e+00,9.83375984067446218261e+00,6.30365647378209459361e+00,13,0,0,0,-9.56232160203639093738e-04,9.98872163274455715509e-03,193,0,1.81676017201793768198e-16,0.0,9.98872163274455715509e-03,0,0,0);
INSERT INTO "samples" VALUES(1,52,0.26,7.06315773299259408446e+00,3.94993582099329909596e+00,9.47366151312642301718e+00,6.06455930088254291376e+00,13,0,0,0,2.01280847094857120137e-04,9.98765305822768567622e-03,209,0,1.81676017201793768198e-16,0.0,9.98765305822768567622e-03,0,0,0);
INSERT INTO "samples" VALUES(1,56,0.28,6.86960731452792394691e+00,3.82913315497018569288e+00,9.09374670804836604531e+00,5.8650494543685844917e+00,14,0,0,0,-0.000814723357559967,9.98668587043072264464e-03,225,0,1.81676017201793768198e-16,0.0,9.98668587043072264464e-03,0,0,0);
INSERT INTO "samples" VALUES(2,0,0.0,8.26781790939016758557e+00,8.26781790939016758557e+00,5.34225669777757605771e+00,7.26781790939016669739e+00,0,0,0,0,0.0,1.3130226768964803341e-02,1,0,0.0,0.0,1.3130226768964803341e-02,0,0,0);
INSERT INTO "samples" VALUES(2,4,0.02,8.16353462115998596004e+00,8.16353462115998596004e+00,5.90002384243140554076e+00,7.16353462115998507186e+00,0,0,0,0,0.0,1.10633016444752207974e-02,17,0,0.0,0.0,1.10633016444752207974e-02,0,0,0);
INSERT INTO "samples" VALUES(2,8,0.04,8.31980620192088693443e+00,7.57260964830207061737e+00,6.71284851949356298206e+00,7.31937284424479450706e+00,2,2,2,0,-1.82109842481759098831e-03,1.0004425089848556496e-02,33,0,4.89125395790202129563e-17,0.0,1.0004425089848556496e-02,0,0,0);
INSERT INTO "samples" VALUES(2,12,0.06,8.34959612643567439249e+00,7.5423705591531753356e+00,7.41277801126484447991e+00,7.35183877697665799644e+00,2,2,2,0,8.47090437943731622283e-05,0.00999783981249891,49,0,4.89125395790202129563e-17,0.0,0.00999783981249891,0,0,0);
INSERT INTO "samples" VALUES(2,16,0.08,8.63504504187966759332e+00,6.93561737205002692974e+00,8.70765320758475702689e+00,7.61352684485086950161e+00,3,3,3,0,-5.04632898815038366535e-03,0.00999770634773256,65,0,6.80637030535337275022e-17,0.0,9.99753606713227327418e-03,0,0,0);
INSERT INTO "samples" VALUES(2,20,0.1,8.93927294541436623376e+00,6.40642340449094671583e+00,9.9670269198447609682e+00,7.89878009663116831262e+00,5,5,5,0,-1.12867205506290146921e-02,9.99754170257061147708e-03,81,0,8.49490964075338413942e-17,0.0,9.99753606713227327418e-03,0,0,0);
INSERT INTO "samples" VALUES(2,24,0.12,9.33495998711560481808e+00,5.9418082956220912294e+00,1.10280699179964276619e+01,8.24702194043885,7,7,6,1,-2.51979894475607424375e-02,9.99742929096791854703e-03,97,0,1.73868841735056977302e-16,0.0,9.99742929096791854703e-03,0,0,0);
INSERT INTO "samples" VALUES(2,28,0.14,9.60326705398744273622e+00,5.36104525328133529882e+00,12.3690157530835,8.66779743736328,8,8,8,0,-0.000396602670665349,9.9953861290802414885e-03,113,0,1.73868841735056977302e-16,0.0,9.9953861290802414885e-03,0,0,0);
INSERT INTO "samples" VALUES(2,32,0.16,9.70403732672895635857e+00,4.73542482422486621373e+00,1.32677047056352748199e+01,8.7578495034201679914e+00,9,9,9,0,-3.0848248031164728555e-04,9.99346513052001839128e-03,129,0,1.73868841735056977302e-16,0.0,9.99346513052001839128e-03,0,0,0);
INSERT INTO "samples" VALUES(2,36,0.18,9.64727020042769,4.72334513115702314678e+00,1.38684759231548468958e+01,8.69870013938651531759e+00,9,9,9,0,1.37398295133154028316e-04,9.99291992121076333432e-03,145,0,1.73868841735056977302e-16,0.0,9.99291992121076333432e-03,0,0,0);
INSERT INTO "samples" VALUES(2,40,0.2,1.02115428137608237339e+01,3.92544349359510258423e+00,1.61627166852513646233e+01,9.24422945483610725148e+00,12,12,12,0,-1.04169442813907661866e-03,9.99191620218420339938e-03,161,0,1.73868841735056977302e-16,0.0,9.99191620218420339938e-03,0,0,0);
INSERT INTO "samples" VALUES(2,44,0.22,1.09055900644556835743e+01,4.00265196934900213676e+00,1.95797917842173205826e+01,9.87288201625681338668e+00,12,12,12,0,1.54967462545629180992e-04,9.99011537988803155485e-03,177,0,1.7574772624818952606e-16,0.0,9.99011537988803155485e-03,0,0,0);
INSERT INTO "samples" VALUES(2,48,0.24,1.22055530992103822285e+01,4.21498510488574940069e+00,2.57903190313539880666e+01,1.09402326106663050353e+01,12,12,12,0,1.79665738914576656121e-04,9.98649424586117717694e-03,193,0,2.12996598982460871862e-16,0.0,9.98649424586117717694e-03,0,0,0);
INSERT INTO "samples" VALUES(2,52,0.26,1.34090197835223872151e+01,4.29266860663193838831e+00,3.21947302826780941127e+01,1.16709060279359704286e+01,13,13,12,1,2.20517115577636345314e-04,0.00997997480832069,209,0,2.8999936498316935163e-16,0.0,0.00997997480832069,0,0,0);
INSERT INTO "samples" VALUES(2,56,0.28,1.32515196393963208265e+01,2.88693720522622143676e+00,33.8413504481909,11.1851901924524,15,15,14,1,-1.96375624958582259069e-03,9.97269240678200219463e-03,225,0,4.20563418988001159462e-16,0.0,9.97243478021170304259e-03,0,0,0);
CREATE TABLE shards (
    name      TEXT PRIMARY KEY,
    size      INTEGER NOT NULL,
    modified  INTEGER NOT NULL,     -- nanoseconds since 1970
    builds    TEXT NOT NULL,        -- JSON: hashes of the executables that computed it
    mixed     INTEGER NOT NULL,     -- whether it was let in although its build was another than the store's
    merged_at INTEGER NOT NULL
);
CREATE TABLE slices (
    submission INTEGER NOT NULL REFERENCES submissions (id),
    case_id    INTEGER NOT NULL REFERENCES cases (id),
    task       INTEGER NOT NULL,
    PRIMARY KEY (submission, case_id)
) WITHOUT ROWID;
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
CREATE INDEX cases_to_do ON cases (state, rank);
CREATE INDEX cases_begun ON cases (rank) WHERE state = 'pending' AND steps_done > 0;
CREATE INDEX failures_of_case ON failures (case_id);
CREATE VIEW runs AS
SELECT c.key, c.state, c.area_fraction, c.friction, c.roughness, c.shear_rate, c.spheres, c.size_ratio,
       c.large_fraction, c.hydrodynamics, c.contact, c.tangential, c.friction_onset, c.stiffness,
       c.tangential_stiffness, c.dashpot, c.lubrication_gap, c.repulsion, c.repulsion_length, c.seed, r.*
FROM cases c LEFT JOIN results r ON r.case_id = c.id
WHERE c.position IS NOT NULL
ORDER BY c.position;
CREATE VIEW viscosity_vs_shear_rate AS
WITH points AS (
    SELECT min(c.position) AS position, c.hydrodynamics, c.contact, c.spheres, c.area_fraction, c.size_ratio,
           c.large_fraction, c.roughness, c.friction, c.tangential, c.friction_onset, c.stiffness, c.tangential_stiffness,
           c.dashpot, c.lubrication_gap, c.repulsion, c.repulsion_length, c.time_step, c.shear_rate, count(r.viscosity) AS runs,
           avg(r.viscosity) AS viscosity,
           CASE WHEN count(r.viscosity) > 1 THEN
               max(avg(r.viscosity * r.viscosity) - avg(r.viscosity) * avg(r.viscosity), 0.0) / (count(r.viscosity) - 1)
           END AS variance,
           min(r.viscosity) AS viscosity_minimum, max(r.viscosity) AS viscosity_maximum,
           avg(r.viscosity_stresslet) AS viscosity_stresslet, avg(r.normal_stress_difference) AS normal_stress_difference,
           total(r.contacts) / nullif(total(r.samples) * c.spheres, 0) AS contacts_per_sphere,
           total(r.activated) / nullif(total(r.contacts), 0) AS activated_fraction,
           total(r.rolling) / nullif(total(r.activated), 0) AS rolling_fraction
    FROM cases c JOIN results r ON r.case_id = c.id
    WHERE c.position IS NOT NULL AND c.state = 'done'
    GROUP BY c.hydrodynamics, c.contact, c.spheres, c.area_fraction, c.size_ratio, c.large_fraction, c.roughness,
             c.friction, c.tangential, c.friction_onset, c.stiffness, c.tangential_stiffness, c.dashpot, c.lubrication_gap,
             c.repulsion, c.repulsion_length, c.time_step, c.shear_rate
)
SELECT hydrodynamics, contact, spheres, area_fraction, size_ratio, large_fraction, roughness, friction, tangential, friction_onset,
       stiffness, tangential_stiffness, dashpot, lubrication_gap, repulsion, repulsion_length, time_step, shear_rate, runs, viscosity,
       -- Square root by Newton's method: not every SQLite has one built in.
       CASE WHEN variance > 0.0 THEN
           (WITH RECURSIVE newton (n, x) AS (
                SELECT 0, 0.5 * (1.0 + variance) UNION ALL SELECT n + 1, 0.5 * (x + variance / x) FROM newton WHERE n < 60)
            SELECT x FROM newton WHERE n = 60)
       ELSE variance END AS standard_error,
       viscosity_minimum, viscosity_maximum, viscosity_stresslet, normal_stress_difference, contacts_per_sphere,
       activated_fraction, rolling_fraction
FROM points
ORDER BY position;
COMMIT;
