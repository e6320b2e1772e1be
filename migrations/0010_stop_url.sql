-- Page of the laboratory's protective stop as browsers reach it; null: it has told none.
ALTER TABLE arenas ADD COLUMN stop_url text;
