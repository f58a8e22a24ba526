"""Computes heights of planned roads by a quadratic program with limits on grades, vertical curves and clearances."""
