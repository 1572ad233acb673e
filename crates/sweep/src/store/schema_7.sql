-- What schema 7 adds to schema 6: what tells damage, and the log of another store.

-- Checksums of what is read back into tables and figures, each written with what it is of.
CREATE TABLE checksums (
    kind  TEXT NOT NULL,        -- campaign, process, result, end, samples, failure
    id    INTEGER NOT NULL,     -- of the row, or of the case the rows belong to
    value INTEGER NOT NULL,     -- the first 64 bits of a BLAKE3 hash of all values that are not NULL, with their names
    PRIMARY KEY (kind, id)
) WITHOUT ROWID;

-- The last link of a chain that every change to the store makes longer by one: its own name and that of the link before. A
-- write-ahead log whose links do not go on from the one in the file belongs to another store, or to another day of this one.
CREATE TABLE log (
    id   INTEGER PRIMARY KEY CHECK (id = 1),
    link BLOB NOT NULL          -- a mark of 16 bytes, the link before (8 bytes), this link (8 bytes)
);
