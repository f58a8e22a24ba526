"""Scenes: their drawn specification, their state at each tick, and how they are drawn from a configuration."""
