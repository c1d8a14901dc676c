-- SPDX-License-Identifier: Apache-2.0
-- Schema 1 of a map file. docs/storage.md says what the columns mean. Never changed again: the text
-- of a schema is compared with that of the files that have it.

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
