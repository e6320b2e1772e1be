-- Virtual runs are carried out by the twin, all others by robots; each side of an arena has its own queue and its own lease.
ALTER TABLE runs ADD COLUMN side text NOT NULL DEFAULT 'physical'
    CONSTRAINT runs_side_known CHECK (side IN ('physical', 'virtual'));
ALTER TABLE leases ADD COLUMN side text NOT NULL DEFAULT 'physical'
    CONSTRAINT leases_side_known CHECK (side IN ('physical', 'virtual'));
ALTER TABLE leases DROP CONSTRAINT leases_arena_unique;
ALTER TABLE leases ADD CONSTRAINT leases_arena_side_unique UNIQUE (arena, side);
DROP INDEX runs_queued;
CREATE INDEX runs_queued ON runs (arena, side, queue_number) WHERE state = 'queued';

-- When the simulation server last asked for a run of this arena.
ALTER TABLE arenas ADD COLUMN simulator_seen_at timestamptz;
