-- What a robot says about itself and how well it is heard; null: it does not tell.
ALTER TABLE robot_status
    ADD COLUMN battery text CONSTRAINT robot_status_battery_known CHECK (battery IN ('good', 'low', 'critical', 'empty')),
    ADD COLUMN rest_v double precision,
    ADD COLUMN stalled boolean,
    ADD COLUMN sensor_fault boolean,
    ADD COLUMN bounded_estimate boolean,
    ADD COLUMN loss_share double precision,
    ADD COLUMN delay_p50_ms double precision,
    ADD COLUMN delay_p95_ms double precision,
    ADD COLUMN jitter_ms double precision,
    ADD CONSTRAINT robot_status_health_whole CHECK (num_nulls(battery, rest_v, stalled, sensor_fault, bounded_estimate) IN (0, 5)),
    ADD CONSTRAINT robot_status_link_whole CHECK (num_nulls(loss_share, delay_p50_ms, delay_p95_ms, jitter_ms) IN (0, 4));

-- Why a robot gets no new run, gravest first; null: it may have one.
CREATE FUNCTION robot_unfit_reason(battery text, stalled boolean, sensor_fault boolean) RETURNS text LANGUAGE sql IMMUTABLE AS $$
    SELECT CASE
        WHEN battery = 'empty'    THEN 'is charging (battery empty)'
        WHEN sensor_fault         THEN 'has to be looked at (a sensor is faulty)'
        WHEN stalled              THEN 'has to be looked at (a motor was blocked)'
        WHEN battery = 'critical' THEN 'is charging (battery critical)'
        WHEN battery = 'low'      THEN 'is charging (battery low)'
    END
$$;
