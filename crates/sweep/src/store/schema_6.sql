-- What schema 6 adds to schema 5: contact problems without a solution, which no program before told apart.

ALTER TABLE samples ADD COLUMN jammed_stages INTEGER NOT NULL DEFAULT 0;
ALTER TABLE results ADD COLUMN jammed_stages INTEGER NOT NULL DEFAULT 0;
ALTER TABLE ends ADD COLUMN jammed_stages INTEGER NOT NULL DEFAULT 0;
