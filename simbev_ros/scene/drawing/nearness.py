"""The area around another agent in which an agent starts or stands."""

from collections.abc import Mapping

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.places import Near
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array


def is_near(
    positions_m: Float64Array,
    near: Near | None,
    others_m: Mapping[str, Float64Array],
    spawn_radius_m: float,
    seed: int,
    purpose: str,
) -> tuple[BoolArray, str]:
    """Draw a distance, if the configuration asks for one, and find the positions at this distance.

    Args:
        positions_m: (N, 3) positions, map frame.
        near: Distance from another agent; None: up to ``spawn_radius_m`` from the first one.
        others_m: (3,) starts of the agents drawn before, the first agent's first, map frame.
        spawn_radius_m: ``traffic.spawn_radius_m``.
        seed: Seed of the scene.
        purpose: Beginning of the names of the agent's random streams.

    Returns:
        (N,) whether an agent may start at each position, and words for the area in which it may.
    """
    first = next(iter(others_m))
    if near is None:
        is_inside = np.linalg.norm(positions_m - others_m[first], axis=1) <= spawn_radius_m
        return is_inside, f"within {spawn_radius_m:g} m (traffic.spawn_radius_m) of {first}"
    other = near.agent or first
    wanted_m = sample(near.distance_m, stream(seed, f"{purpose}.distance"))
    low_m, high_m = wanted_m - near.tolerance_m, wanted_m + near.tolerance_m
    distance_m = np.linalg.norm(positions_m[:, :2] - others_m[other][:2], axis=1)
    return (low_m <= distance_m) & (distance_m <= high_m), f"{max(low_m, 0.0):.4g} to {high_m:.4g} m from {other}"
