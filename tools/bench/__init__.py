"""Benchmarks: what the graph, cameras, rays, labels, recording and evaluation cost on this machine."""
