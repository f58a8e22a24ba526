"""The land between the streets of one region: its division, what covers it, and what stands on it."""
