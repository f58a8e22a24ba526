"""Conversion factors between units, and constants of physics."""

NS_PER_S = 1_000_000_000
S_PER_NS = 1e-9
S_PER_H = 3600
GRAVITY_MPS2 = 9.81
