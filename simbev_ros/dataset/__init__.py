"""Datasets: which scenes they are to have, which they have, and reading them."""
