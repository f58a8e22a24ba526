"""The lanes of a map that are too tight for long vehicles: found once, then read from the cache beside the map's."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path

import numpy as np

from simbev_ros.errors import NPZ_DAMAGE
from simbev_ros.maps.cache import code_version, folder_of
from simbev_ros.maps.cache_ageing import discard
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.blueprints import Footprint, load_blueprints
from simbev_ros.scene.streets.off_tracking import Obstacles, bent_ways, is_long, unfit
from simbev_ros.types import BoolArray, Int64Array

_FILE = "tight.npy"


def tight_lanes(network: RoadNetwork, following: Int64Array) -> Mapping[Footprint, BoolArray]:
    """For each long vehicle's footprint, (L,) which driving lanes it must not take.

    Args:
        network: The map.
        following: (K, 2) rows of driving lanes and of those that follow them.

    Raises:
        InputError: The cache cannot be written.
    """
    bodies = sorted({each.footprint for each in load_blueprints() if each.kind == "vehicle" and is_long(each)})
    driving, sidewalks = network.lanes_of(LaneKind.DRIVING), network.lanes_of(LaneKind.SIDEWALK)
    build = partial(_build, bodies, driving, sidewalks, following)
    cache_dir = network.net_path.parents[2]  # it holds a folder of maps, and that a folder of each map
    while True:
        key = _key(bodies, driving, sidewalks, following)
        folder = folder_of("turns", network.name, _version(), key, build, cache_dir)
        try:
            tight = np.load(folder / _FILE, allow_pickle=False)
            return dict(zip(bodies, tight.reshape(len(bodies), len(driving)), strict=True))
        except NPZ_DAMAGE:
            discard(folder)


def _build(
    bodies: Sequence[Footprint], driving: Sequence[Lane], sidewalks: Sequence[Lane], following: Int64Array, folder: Path
) -> None:
    """Fill a folder of the cache."""
    ways = bent_ways(driving, following)
    body, way = np.nonzero(unfit(bodies, ways, Obstacles(driving, sidewalks)))
    tight = np.zeros((len(bodies), len(driving)), bool)
    tight[body, ways.decisive[way]] = True
    np.save(folder / _FILE, tight, allow_pickle=False)


def _key(
    bodies: Sequence[Footprint], driving: Sequence[Lane], sidewalks: Sequence[Lane], following: Int64Array
) -> bytes:
    """All that decides the content: the vehicles and the lanes."""
    lanes = (*driving, *sidewalks)
    named = json.dumps(
        [bodies, len(driving), [(lane.junction, lane.width_m, len(lane.centerline_m)) for lane in lanes]]
    )
    content = hashlib.sha256(named.encode())
    content.update(np.concatenate([np.empty((0, 3)), *(lane.centerline_m for lane in lanes)]).tobytes())
    content.update(following.tobytes())
    return content.digest()


def _version() -> bytes:
    """That of the code."""
    here = (files("simbev_ros.scene.streets").joinpath(name) for name in ("off_tracking.py", "tight_turns.py"))
    return b"".join((code_version(), *(module.read_bytes() for module in here)))
