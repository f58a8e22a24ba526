"""Serves bags to Foxglove and Lichtblick over a WebSocket."""
