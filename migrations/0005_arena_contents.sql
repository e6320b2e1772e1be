-- Obstacles, floor regions and tilt of an arena, as the laboratory wrote them; none: an empty room with a level floor.
ALTER TABLE arenas ADD COLUMN contents json;
