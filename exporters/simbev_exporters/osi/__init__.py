"""Exporter to ground truth of ASAM OSI, the Open Simulation Interface, in trace files."""
