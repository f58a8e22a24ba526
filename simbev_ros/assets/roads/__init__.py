"""Roads as meshes: the ground of streets, markings, bridges, pillars and guard rails."""
