"""How drivers behave beyond SUMO: they predict conflicts and brake, move aside, and slow down in rain."""
