-- What a robot does that is in no run; null: nothing, or a laboratory without docks.
ALTER TABLE robot_status
    ADD COLUMN activity text CONSTRAINT robot_status_activity_known CHECK (activity IN ('driving_home', 'charging'));
