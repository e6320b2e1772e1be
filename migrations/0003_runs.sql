-- An experiment is a document that never changes; its run has the state; an attempt is (run, epoch).
CREATE TABLE experiments (
    id             uuid PRIMARY KEY,
    user_id        uuid NOT NULL REFERENCES users (id),
    label          text NOT NULL,
    document       json NOT NULL,
    claimed_digest text,
    claimed_twin_version text,
    claimed_engine text,
    submitted_at   timestamptz NOT NULL DEFAULT clock_timestamp()
);
CREATE INDEX experiments_user ON experiments (user_id, submitted_at DESC);
CREATE INDEX experiments_submitted ON experiments (submitted_at DESC);

CREATE FUNCTION experiments_refuse_change() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'experiment % is immutable', OLD.id
        USING ERRCODE = 'check_violation', CONSTRAINT = 'experiments_immutable';
END $$;
CREATE TRIGGER experiments_immutable BEFORE UPDATE OR DELETE ON experiments
    FOR EACH ROW EXECUTE FUNCTION experiments_refuse_change();

-- One row per (user, key); a key is free again after 24 h.
CREATE TABLE idempotency_keys (
    user_id       uuid NOT NULL REFERENCES users (id),
    key           text NOT NULL,
    request_hash  bytea NOT NULL,
    experiment_id uuid NOT NULL REFERENCES experiments (id) DEFERRABLE INITIALLY DEFERRED,
    created_at    timestamptz NOT NULL DEFAULT clock_timestamp(),
    PRIMARY KEY (user_id, key),
    CONSTRAINT idempotency_keys_key_length CHECK (char_length(key) BETWEEN 1 AND 200),
    CONSTRAINT idempotency_keys_hash_length CHECK (octet_length(request_hash) = 32)
);
CREATE INDEX idempotency_keys_created ON idempotency_keys (created_at);

-- Grows over all runs, so a robot may refuse everything below the largest epoch it saw. The link carries 32 bits.
CREATE SEQUENCE epochs AS bigint MINVALUE 1 MAXVALUE 4294967295 NO CYCLE;

CREATE TABLE runs (
    id            uuid PRIMARY KEY,
    experiment_id uuid NOT NULL CONSTRAINT runs_experiment_unique UNIQUE REFERENCES experiments (id),
    user_id       uuid NOT NULL REFERENCES users (id),
    -- Place in the queue; a run that goes back to the queue keeps it.
    queue_number  bigint GENERATED ALWAYS AS IDENTITY,
    -- Taken out of the experiment, for the queue.
    arena         text NOT NULL,
    robot_names   text[] NOT NULL,
    duration_s    double precision NOT NULL,
    state         text NOT NULL DEFAULT 'validating',
    epoch         bigint NOT NULL DEFAULT 0,
    attempts      integer NOT NULL DEFAULT 0,
    motion_begun  boolean NOT NULL DEFAULT false,
    cancel_requested    boolean NOT NULL DEFAULT false,
    cancel_requested_by text,
    fault_whose   text CONSTRAINT runs_fault_whose_known CHECK (fault_whose IN ('user', 'platform', 'robot', 'operator')),
    fault_code    text,
    fault_message text,
    server_digest text,
    server_twin_version text,
    verdict       json,
    ticks_recorded bigint,
    ticks_missed  bigint,
    created_at    timestamptz NOT NULL DEFAULT clock_timestamp(),
    queued_at     timestamptz,
    claimed_at    timestamptz,
    started_at    timestamptz,
    ended_at      timestamptz,
    CONSTRAINT runs_state_known CHECK (state IN ('draft', 'validating', 'rejected', 'queued', 'preparing', 'running',
        'uploading', 'done', 'failed', 'cancelled', 'interrupted')),
    CONSTRAINT runs_fault_whole CHECK (num_nulls(fault_whose, fault_code, fault_message) IN (0, 3)),
    CONSTRAINT runs_fault_given CHECK (state NOT IN ('rejected', 'failed', 'cancelled', 'interrupted') OR fault_code IS NOT NULL),
    CONSTRAINT runs_end_dated CHECK ((state IN ('rejected', 'done', 'failed', 'cancelled', 'interrupted')) = (ended_at IS NOT NULL)),
    CONSTRAINT runs_done_moved CHECK (state <> 'done' OR motion_begun)
) WITH (fillfactor = 70);
CREATE INDEX runs_queued ON runs (arena, queue_number) WHERE state = 'queued';
CREATE INDEX runs_user ON runs (user_id, queue_number DESC);
CREATE INDEX runs_newest ON runs (queue_number DESC);

-- One row per live attempt, so that an arena has one commander: the row goes when the attempt ends.
CREATE TABLE leases (
    run_id     uuid NOT NULL REFERENCES runs (id),
    epoch      bigint NOT NULL,
    arena      text NOT NULL CONSTRAINT leases_arena_unique UNIQUE REFERENCES arenas (name),
    instance   uuid NOT NULL,
    expires_at timestamptz NOT NULL,
    beat_at    timestamptz NOT NULL,
    CONSTRAINT leases_run_epoch_unique UNIQUE (run_id, epoch)
) WITH (fillfactor = 50);

CREATE TABLE attempts (
    run_id     uuid NOT NULL REFERENCES runs (id),
    epoch      bigint NOT NULL CONSTRAINT attempts_epoch_unique UNIQUE,
    lab        text NOT NULL,
    instance   uuid NOT NULL,
    claimed_at timestamptz NOT NULL DEFAULT clock_timestamp(),
    ended_at   timestamptz,
    outcome    text,
    PRIMARY KEY (run_id, epoch)
);

-- Epoch 0 is the rehearsal. The bytes lie in the object folder before the row is written.
CREATE TABLE run_files (
    run_id      uuid NOT NULL REFERENCES runs (id),
    epoch       bigint NOT NULL,
    name        text NOT NULL,
    bytes       bigint NOT NULL CONSTRAINT run_files_bytes_range CHECK (bytes >= 0),
    sha256      text NOT NULL CONSTRAINT run_files_sha256_hex CHECK (sha256 ~ '^[0-9a-f]{64}$'),
    media_type  text NOT NULL,
    object_path text NOT NULL,
    created_at  timestamptz NOT NULL DEFAULT clock_timestamp(),
    PRIMARY KEY (run_id, epoch, name),
    CONSTRAINT run_files_name_length CHECK (char_length(name) BETWEEN 1 AND 400)
);

-- States only move along these edges; terminal states have none.
CREATE FUNCTION run_transition_allowed(old_state text, new_state text) RETURNS boolean LANGUAGE sql IMMUTABLE AS $$
    SELECT CASE old_state
        WHEN 'draft'      THEN new_state IN ('validating', 'cancelled')
        WHEN 'validating' THEN new_state IN ('queued', 'rejected', 'failed', 'cancelled')
        WHEN 'queued'     THEN new_state IN ('preparing', 'cancelled')
        WHEN 'preparing'  THEN new_state IN ('queued', 'running', 'uploading', 'failed', 'cancelled', 'interrupted')
        WHEN 'running'    THEN new_state IN ('uploading', 'failed', 'cancelled', 'interrupted')
        WHEN 'uploading'  THEN new_state IN ('done', 'failed', 'cancelled', 'interrupted')
        ELSE false
    END
$$;

CREATE FUNCTION runs_guard() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF TG_OP = 'INSERT' THEN
        IF NEW.state NOT IN ('draft', 'validating') THEN
            RAISE EXCEPTION 'a run starts as validating, not as %', NEW.state
                USING ERRCODE = 'check_violation', CONSTRAINT = 'runs_transition_allowed';
        END IF;
        RETURN NEW;
    END IF;
    IF OLD.state IN ('rejected', 'done', 'failed', 'cancelled', 'interrupted') THEN
        -- Only the counts that a laboratory finds while it salvages may still be filled in.
        IF (NEW.state, NEW.epoch, NEW.attempts, NEW.motion_begun, NEW.cancel_requested, NEW.ended_at, NEW.verdict::text)
            IS DISTINCT FROM
           (OLD.state, OLD.epoch, OLD.attempts, OLD.motion_begun, OLD.cancel_requested, OLD.ended_at, OLD.verdict::text)
           OR (NEW.fault_whose, NEW.fault_code, NEW.fault_message, NEW.server_digest, NEW.experiment_id)
            IS DISTINCT FROM
           (OLD.fault_whose, OLD.fault_code, OLD.fault_message, OLD.server_digest, OLD.experiment_id)
        THEN
            RAISE EXCEPTION 'run % ended as % and no longer changes', OLD.id, OLD.state
                USING ERRCODE = 'check_violation', CONSTRAINT = 'runs_terminal_is_terminal';
        END IF;
    ELSIF NEW.state <> OLD.state AND NOT run_transition_allowed(OLD.state, NEW.state) THEN
        RAISE EXCEPTION 'run % may not go from % to %', OLD.id, OLD.state, NEW.state
            USING ERRCODE = 'check_violation', CONSTRAINT = 'runs_transition_allowed';
    END IF;
    IF NEW.epoch < OLD.epoch
       OR (NEW.state = 'preparing' AND OLD.state <> 'preparing' AND NEW.epoch = OLD.epoch)
       OR (NEW.state = 'queued' AND OLD.motion_begun) THEN
        RAISE EXCEPTION 'run %: an attempt needs a larger epoch, and a run that moved is not queued again', OLD.id
            USING ERRCODE = 'check_violation', CONSTRAINT = 'runs_epoch_grows';
    END IF;
    RETURN NEW;
END $$;
CREATE TRIGGER runs_guard BEFORE INSERT OR UPDATE ON runs FOR EACH ROW EXECUTE FUNCTION runs_guard();

CREATE FUNCTION runs_refuse_delete() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'run % is kept', OLD.id
        USING ERRCODE = 'check_violation', CONSTRAINT = 'runs_kept';
END $$;
CREATE TRIGGER runs_kept BEFORE DELETE ON runs FOR EACH ROW EXECUTE FUNCTION runs_refuse_delete();

CREATE FUNCTION runs_notify() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    PERFORM pg_notify('robopheus_runs', NEW.id::text);
    RETURN NULL;
END $$;
CREATE TRIGGER runs_notify_insert AFTER INSERT ON runs FOR EACH ROW EXECUTE FUNCTION runs_notify();
CREATE TRIGGER runs_notify_change AFTER UPDATE ON runs FOR EACH ROW
    WHEN (OLD.state <> NEW.state OR OLD.cancel_requested <> NEW.cancel_requested)
    EXECUTE FUNCTION runs_notify();
