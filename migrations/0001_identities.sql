-- Who may do what. A token is shown once; only its SHA-256 is kept.
CREATE TABLE users (
    id         uuid PRIMARY KEY DEFAULT gen_random_uuid(),
    name       text NOT NULL CONSTRAINT users_name_unique UNIQUE,
    created_at timestamptz NOT NULL DEFAULT clock_timestamp(),
    CONSTRAINT users_name_length CHECK (char_length(name) BETWEEN 1 AND 100)
);

CREATE TABLE tokens (
    id         uuid PRIMARY KEY DEFAULT gen_random_uuid(),
    user_id    uuid NOT NULL REFERENCES users (id),
    role       text NOT NULL CONSTRAINT tokens_role_known CHECK (role IN ('user', 'operator', 'lab', 'scheduler')),
    -- First characters of the plain token, so that a person can tell tokens apart.
    prefix     text NOT NULL,
    sha256     bytea NOT NULL CONSTRAINT tokens_sha256_unique UNIQUE,
    created_at timestamptz NOT NULL DEFAULT clock_timestamp(),
    revoked_at timestamptz,
    CONSTRAINT tokens_sha256_length CHECK (octet_length(sha256) = 32)
);
CREATE INDEX tokens_user ON tokens (user_id);
