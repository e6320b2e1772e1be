-- Work of the scheduler. `attempt` fences every write of a worker.
CREATE TABLE jobs (
    id           uuid PRIMARY KEY,
    kind         text NOT NULL,
    run_id       uuid NOT NULL REFERENCES runs (id),
    state        text NOT NULL DEFAULT 'ready'
        CONSTRAINT jobs_state_known CHECK (state IN ('ready', 'leased', 'done', 'failed', 'dropped')),
    attempt      integer NOT NULL DEFAULT 0,
    -- Attempts that ended because their worker was asked to stop; they do not count against the job.
    released     integer NOT NULL DEFAULT 0,
    worker       uuid,
    leased_until timestamptz,
    ready_at     timestamptz NOT NULL DEFAULT clock_timestamp(),
    error        text,
    created_at   timestamptz NOT NULL DEFAULT clock_timestamp(),
    ended_at     timestamptz,
    CONSTRAINT jobs_kind_run_unique UNIQUE (kind, run_id),
    CONSTRAINT jobs_lease_whole CHECK ((state = 'leased') = (leased_until IS NOT NULL) AND (state <> 'leased' OR worker IS NOT NULL))
) WITH (fillfactor = 70);
CREATE INDEX jobs_ready ON jobs (kind, ready_at, created_at) WHERE state = 'ready';
CREATE INDEX jobs_leased ON jobs (leased_until) WHERE state = 'leased';
CREATE INDEX jobs_run ON jobs (run_id);

CREATE FUNCTION jobs_guard() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF OLD.state IN ('done', 'failed', 'dropped') AND NEW.state <> OLD.state THEN
        RAISE EXCEPTION 'job % ended as %', OLD.id, OLD.state
            USING ERRCODE = 'check_violation', CONSTRAINT = 'jobs_terminal_is_terminal';
    END IF;
    RETURN NEW;
END $$;
CREATE TRIGGER jobs_guard BEFORE UPDATE ON jobs FOR EACH ROW EXECUTE FUNCTION jobs_guard();

CREATE FUNCTION jobs_notify() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    PERFORM pg_notify('robopheus_jobs', '');
    RETURN NULL;
END $$;
CREATE TRIGGER jobs_notify AFTER INSERT ON jobs FOR EACH STATEMENT EXECUTE FUNCTION jobs_notify();
