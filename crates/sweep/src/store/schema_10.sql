-- What schema 10 adds to schema 9: seeds that a precision decides on, computing time by the processor, and whether runs are steady.

-- Points at which a precision is asked for.
CREATE TABLE rules (
    point     INTEGER PRIMARY KEY,
    precision REAL NOT NULL,        -- half width of the 95 % interval over the mean
    quantity  TEXT NOT NULL,        -- a column of results
    at_least  INTEGER NOT NULL,
    at_most   INTEGER NOT NULL
);

-- The point of a case that such a rule decides on, and the position it has once its seed counts: until then that is NULL.
ALTER TABLE cases ADD COLUMN point INTEGER;
ALTER TABLE cases ADD COLUMN reserve INTEGER;
CREATE INDEX cases_of_point ON cases (point, reserve) WHERE point IS NOT NULL;
-- What a case of such a point is worth per second, among cases of one rank: the dearest first.
ALTER TABLE cases ADD COLUMN gain REAL NOT NULL DEFAULT 0.0;

-- Seconds of processor; NULL in runs finished under schema 9 or before.
ALTER TABLE results ADD COLUMN cpu_time_s REAL;
-- Means of the viscosity over the four equal parts of the samples averaged, their variance, and how many samples apart two
-- count as independent.
ALTER TABLE results ADD COLUMN viscosity_part_1 REAL;
ALTER TABLE results ADD COLUMN viscosity_part_2 REAL;
ALTER TABLE results ADD COLUMN viscosity_part_3 REAL;
ALTER TABLE results ADD COLUMN viscosity_part_4 REAL;
ALTER TABLE results ADD COLUMN viscosity_variance REAL;
ALTER TABLE results ADD COLUMN viscosity_correlation REAL;
