-- Diagnoses are jobs of their own kind: leased, fenced by `attempt`, retried. Model versions never change; which one a
-- robot's twin uses from when is a record that only grows.
ALTER TABLE models
    -- SHA-256 of the document without its id.
    ADD COLUMN document_id text CONSTRAINT models_document_unique UNIQUE,
    ADD COLUMN parent uuid REFERENCES models (id);
CREATE INDEX models_robot ON models (robot, floor, created_at DESC);

CREATE FUNCTION refuse_change() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'a row of % is never changed', TG_TABLE_NAME
        USING ERRCODE = 'check_violation', CONSTRAINT = TG_TABLE_NAME || '_immutable';
END $$;
CREATE TRIGGER models_immutable BEFORE UPDATE OR DELETE ON models FOR EACH ROW EXECUTE FUNCTION refuse_change();

CREATE TABLE diagnoses (
    id           uuid PRIMARY KEY,
    user_id      uuid NOT NULL REFERENCES users (id),
    robot        text NOT NULL,
    arena        text NOT NULL,
    floor        text NOT NULL,
    -- Who wanted it: a person, the gap of a run, or the run that an earlier diagnosis proposed.
    origin       text NOT NULL CONSTRAINT diagnoses_origin_known CHECK (origin IN ('person', 'gap', 'follow_up')),
    follows      uuid REFERENCES diagnoses (id),
    -- The model that should explain the runs; null: the nominal twin.
    parent_model uuid REFERENCES models (id),
    state        text NOT NULL DEFAULT 'queued'
        CONSTRAINT diagnoses_state_known CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    attempt      integer NOT NULL DEFAULT 0,
    -- Attempts that ended because their worker was asked to stop; they do not count.
    released     integer NOT NULL DEFAULT 0,
    worker       uuid,
    leased_until timestamptz,
    ready_at     timestamptz NOT NULL DEFAULT clock_timestamp(),
    cancel_requested    boolean NOT NULL DEFAULT false,
    cancel_requested_by text,
    progress     double precision NOT NULL DEFAULT 0 CONSTRAINT diagnoses_progress_range CHECK (progress BETWEEN 0 AND 1),
    stage        text NOT NULL DEFAULT '',
    verdict      text,
    sentence     text,
    next_why     text,
    report       json,
    page_path    text,
    page_sha256  text,
    page_bytes   bigint,
    model_id     uuid REFERENCES models (id),
    problem_code    text,
    problem_message text,
    -- The run of the proposed experiment.
    next_run     uuid CONSTRAINT diagnoses_next_run_unique UNIQUE REFERENCES runs (id),
    created_at   timestamptz NOT NULL DEFAULT clock_timestamp(),
    started_at   timestamptz,
    ended_at     timestamptz,
    CONSTRAINT diagnoses_lease_whole CHECK ((state = 'running') = (leased_until IS NOT NULL) AND (state <> 'running' OR worker IS NOT NULL)),
    CONSTRAINT diagnoses_end_dated CHECK ((state IN ('done', 'failed', 'cancelled')) = (ended_at IS NOT NULL)),
    CONSTRAINT diagnoses_result_whole CHECK ((state = 'done') = (report IS NOT NULL)
        AND num_nulls(verdict, sentence, report, page_path, page_sha256, page_bytes, model_id) IN (0, 7)),
    CONSTRAINT diagnoses_problem_given CHECK ((state IN ('failed', 'cancelled')) = (problem_code IS NOT NULL)
        AND num_nulls(problem_code, problem_message) IN (0, 2)),
    CONSTRAINT diagnoses_follow_up_follows CHECK ((origin = 'follow_up') = (follows IS NOT NULL))
) WITH (fillfactor = 70);
CREATE INDEX diagnoses_ready ON diagnoses (ready_at, created_at) WHERE state = 'queued';
CREATE INDEX diagnoses_leased ON diagnoses (leased_until) WHERE state = 'running';
CREATE INDEX diagnoses_newest ON diagnoses (created_at DESC, id DESC);
CREATE INDEX diagnoses_robot ON diagnoses (robot, created_at DESC);
CREATE INDEX diagnoses_user ON diagnoses (user_id, created_at DESC);
-- Gaps ask for one diagnosis of a robot at a time, and every proposed run for one.
CREATE UNIQUE INDEX diagnoses_one_of_gap ON diagnoses (robot, floor) WHERE origin = 'gap' AND state IN ('queued', 'running');
CREATE UNIQUE INDEX diagnoses_one_follow_up ON diagnoses (follows) WHERE origin = 'follow_up';

CREATE TABLE diagnosis_runs (
    diagnosis_id uuid NOT NULL REFERENCES diagnoses (id),
    run_id       uuid NOT NULL REFERENCES runs (id),
    role         text NOT NULL CONSTRAINT diagnosis_runs_role_known CHECK (role IN ('reference', 'changed', 'locked')),
    place        integer NOT NULL,
    PRIMARY KEY (diagnosis_id, run_id)
);
CREATE INDEX diagnosis_runs_run ON diagnosis_runs (run_id);

CREATE FUNCTION diagnoses_guard() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF OLD.state IN ('done', 'failed', 'cancelled') AND
       (NEW.state, NEW.model_id, NEW.report::text, NEW.problem_code) IS DISTINCT FROM (OLD.state, OLD.model_id, OLD.report::text, OLD.problem_code)
    THEN
        RAISE EXCEPTION 'diagnosis % ended as %', OLD.id, OLD.state
            USING ERRCODE = 'check_violation', CONSTRAINT = 'diagnoses_terminal_is_terminal';
    END IF;
    RETURN NEW;
END $$;
CREATE TRIGGER diagnoses_guard BEFORE UPDATE ON diagnoses FOR EACH ROW EXECUTE FUNCTION diagnoses_guard();
CREATE TRIGGER diagnoses_notify AFTER INSERT ON diagnoses FOR EACH STATEMENT EXECUTE FUNCTION jobs_notify();

-- As `idempotency_keys`, for diagnoses.
CREATE TABLE diagnosis_keys (
    user_id      uuid NOT NULL REFERENCES users (id),
    key          text NOT NULL,
    request_hash bytea NOT NULL,
    diagnosis_id uuid NOT NULL REFERENCES diagnoses (id) DEFERRABLE INITIALLY DEFERRED,
    created_at   timestamptz NOT NULL DEFAULT clock_timestamp(),
    PRIMARY KEY (user_id, key),
    CONSTRAINT diagnosis_keys_key_length CHECK (char_length(key) BETWEEN 1 AND 200),
    CONSTRAINT diagnosis_keys_hash_length CHECK (octet_length(request_hash) = 32)
);
CREATE INDEX diagnosis_keys_created ON diagnosis_keys (created_at);

-- Which model a robot's twin uses on a floor: the newest row; null: the nominal twin.
CREATE TABLE model_uses (
    number       bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    robot        text NOT NULL,
    floor        text NOT NULL,
    model_id     uuid REFERENCES models (id),
    diagnosis_id uuid REFERENCES diagnoses (id),
    chosen_by    text NOT NULL,
    since        timestamptz NOT NULL DEFAULT clock_timestamp()
);
CREATE INDEX model_uses_newest ON model_uses (robot, floor, number DESC);
CREATE TRIGGER model_uses_immutable BEFORE UPDATE OR DELETE ON model_uses FOR EACH ROW EXECUTE FUNCTION refuse_change();

CREATE FUNCTION current_model(of_robot text, on_floor text) RETURNS uuid LANGUAGE sql STABLE AS $$
    SELECT model_id FROM model_uses WHERE robot = of_robot AND floor = on_floor ORDER BY number DESC LIMIT 1
$$;

-- Models that an experiment is rehearsed with, as they were when it was submitted; robots without a row have the nominal twin.
CREATE TABLE experiment_models (
    experiment_id uuid NOT NULL REFERENCES experiments (id),
    robot         text NOT NULL,
    model_id      uuid NOT NULL REFERENCES models (id),
    PRIMARY KEY (experiment_id, robot)
);

-- Runs in which nothing was changed, by robot.
CREATE TABLE robot_references (
    robot  text NOT NULL,
    floor  text NOT NULL,
    run_id uuid NOT NULL REFERENCES runs (id),
    set_by text NOT NULL,
    set_at timestamptz NOT NULL DEFAULT clock_timestamp(),
    PRIMARY KEY (robot, floor, run_id)
);

-- End-to-end gap of a robot in a run under a model; null model: the nominal twin.
CREATE TABLE run_gaps (
    run_id      uuid NOT NULL REFERENCES runs (id),
    robot       text NOT NULL,
    model_id    uuid REFERENCES models (id),
    -- List of {horizon_s, position_m, yaw_rad, samples}; absent when there is a problem.
    horizons    json,
    position_m  double precision,
    problem     text,
    measured_at timestamptz NOT NULL DEFAULT clock_timestamp(),
    CONSTRAINT run_gaps_once UNIQUE NULLS NOT DISTINCT (run_id, robot, model_id),
    CONSTRAINT run_gaps_or_problem CHECK ((horizons IS NULL) = (problem IS NOT NULL))
);
CREATE INDEX run_gaps_robot ON run_gaps (robot, model_id);
