"""Judges how a vehicle drives a route: infractions tick by tick from the true state, and the scores of benchmarks."""
