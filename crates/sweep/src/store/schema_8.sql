-- What schema 8 adds to schema 7: which finished runs are doubtful.

-- Names of the rules it broke, separated by commas, as doubt.rs has them; empty for a sound run, NULL until it is judged.
ALTER TABLE results ADD COLUMN doubts TEXT;
