-- A map file of schema 1, as released: every later program must read it. The checksums were computed
-- apart from the program.
PRAGMA journal_mode = WAL;
PRAGMA application_id = 1280262985;


-- The event log: numbers without gaps.
CREATE TABLE log (
  number    INTEGER PRIMARY KEY,
  end_bytes INTEGER NOT NULL,  -- bytes of all entries up to this one since the map began
  checksum  INTEGER NOT NULL,
  bytes     BLOB    NOT NULL
) STRICT;

-- How far the log has been trimmed: at most one row, none before the first trim.
CREATE TABLE log_trim (
  id        INTEGER PRIMARY KEY CHECK (id = 1),
  number    INTEGER NOT NULL,  -- of the last entry removed
  end_bytes INTEGER NOT NULL,  -- of that entry
  checksum  INTEGER NOT NULL
) STRICT;

-- Valid checkpoints, named by the last event that they contain.
CREATE TABLE checkpoint (
  last_event   INTEGER PRIMARY KEY,
  state_digest TEXT    NOT NULL,
  record_count INTEGER NOT NULL,
  checksum_sum INTEGER NOT NULL,  -- of the checksums of its records
  checksum     INTEGER NOT NULL
) STRICT;

-- One version of one record. Checkpoint c contains it if valid_from <= c and c < valid_until.
CREATE TABLE record (
  blob_id     INTEGER PRIMARY KEY,
  kind        INTEGER NOT NULL,
  id          INTEGER NOT NULL,
  valid_from  INTEGER NOT NULL,
  valid_until INTEGER,             -- null: no later checkpoint has changed it
  size_bytes  INTEGER NOT NULL,    -- before compression
  stored_size_bytes INTEGER NOT NULL,
  checksum    INTEGER NOT NULL
) STRICT;
CREATE UNIQUE INDEX record_by_name ON record (kind, id, valid_from);
CREATE INDEX record_by_end ON record (valid_until) WHERE valid_until IS NOT NULL;

-- The bytes of records, apart from them: ending a record must not write its bytes again.
CREATE TABLE blob (
  id    INTEGER PRIMARY KEY,
  bytes BLOB NOT NULL
) STRICT;

PRAGMA user_version = 1;

INSERT INTO log_trim VALUES (1, 1, 6, 52031287);
INSERT INTO log VALUES (2, 12, 3294247262, x'010402000000');
INSERT INTO log VALUES (3, 18, 1094666928, x'010403000000');
INSERT INTO log VALUES (4, 24, 3394691289, x'010404000000');
INSERT INTO checkpoint VALUES (2, '00ff', 2, 7156873390, 251548314);
INSERT INTO checkpoint VALUES (3, '01ff', 3, 5085655417, 1045399435);
INSERT INTO record VALUES (1, 1, 7, 2, NULL, 2, 2, 4008281526);
INSERT INTO blob VALUES (1, x'6869');
INSERT INTO record VALUES (2, 1, 8, 2, 3, 3, 3, 3148591864);
INSERT INTO blob VALUES (2, x'6f6c64');
INSERT INTO record VALUES (3, 1, 8, 3, NULL, 3, 3, 711525173);
INSERT INTO blob VALUES (3, x'6e6577');
INSERT INTO record VALUES (4, 100, -1, 3, NULL, 200, 18, 365848718);
INSERT INTO blob VALUES (4, x'28b52ffd20c84d00001061610100430a6001');
