-- What a laboratory registered, and what it said last. Documents are `json`, not `jsonb`: the text is kept
-- as written, because `jsonb` turns -0.0 into 0 and the twin compares bit for bit.
CREATE TABLE arenas (
    name          text PRIMARY KEY,
    lab           text NOT NULL,
    width_m       double precision NOT NULL CONSTRAINT arenas_width_positive CHECK (width_m > 0),
    height_m      double precision NOT NULL CONSTRAINT arenas_height_positive CHECK (height_m > 0),
    floor         text NOT NULL,
    registered_at timestamptz NOT NULL DEFAULT clock_timestamp(),
    -- Held after a lease was lost, until then or until the laboratory registers again.
    held_until    timestamptz,
    held_reason   text
);

CREATE TABLE robots (
    arena    text NOT NULL REFERENCES arenas (name),
    name     text NOT NULL,
    number   smallint NOT NULL CONSTRAINT robots_number_range CHECK (number BETWEEN 1 AND 250),
    document json NOT NULL,
    PRIMARY KEY (arena, name),
    -- Deferred, so that a laboratory may swap two numbers.
    CONSTRAINT robots_number_unique UNIQUE (arena, number) DEFERRABLE INITIALLY DEFERRED
);

-- Written about once a second, hence narrow, without an index on what changes.
CREATE TABLE arena_status (
    arena   text PRIMARY KEY REFERENCES arenas (name),
    stopped boolean NOT NULL DEFAULT false,
    seen_at timestamptz NOT NULL
) WITH (fillfactor = 50);

CREATE TABLE robot_status (
    arena   text NOT NULL,
    name    text NOT NULL,
    online  boolean NOT NULL,
    bus_v   double precision,
    seen_at timestamptz NOT NULL,
    PRIMARY KEY (arena, name),
    FOREIGN KEY (arena, name) REFERENCES robots (arena, name) ON DELETE CASCADE
) WITH (fillfactor = 50);

CREATE TABLE models (
    id         uuid PRIMARY KEY DEFAULT gen_random_uuid(),
    version    text NOT NULL CONSTRAINT models_version_unique UNIQUE,
    robot      text NOT NULL,
    floor      text NOT NULL,
    document   json NOT NULL,
    created_at timestamptz NOT NULL DEFAULT clock_timestamp()
);
