"""Named random streams: each purpose has its own generator, so that one purpose never shifts another's numbers."""

import hashlib

import numpy as np


def stream(seed: int, name: str, tick: int = 0) -> np.random.Generator:
    """Random generator for one purpose, determined by seed, name and tick alone.

    Args:
        seed: Seed of the scene or map.
        name: Purpose of the numbers, e.g. ``lidar.noise``.
        tick: For noise, the current tick, so that a replay that starts later repeats the same noise.
    """
    key = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, key, tick & 0xFFFFFFFF])))
