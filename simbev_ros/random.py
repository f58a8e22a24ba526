"""Random streams: each has its own generator, keyed by seed and name, so that none disturbs another."""

import hashlib

import numpy as np


def stream(seed: int, name: str, tick: int = 0) -> np.random.Generator:
    """The generator of a named stream.

    Args:
        seed: The scene's seed.
        name: What is drawn from it, e.g. ``lidar.noise``.
        tick: For noise: the tick, so that a replay that starts later repeats it.
    """
    key = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, key, tick & 0xFFFFFFFF])))
