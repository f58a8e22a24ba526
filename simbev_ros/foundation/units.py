"""Conversion factors between units."""

NS_PER_S = 1_000_000_000
S_PER_H = 3600
