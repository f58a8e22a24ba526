"""A recorded scene as a source of motion."""
