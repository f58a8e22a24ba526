"""Tests that share one live graph."""
