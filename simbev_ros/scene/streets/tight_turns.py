"""The lanes of a map that are too tight for long vehicles, computed once and cached with the map."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from simbev_ros.foundation.cache.entries import discard_entry
from simbev_ros.foundation.cache.fingerprint import fingerprint
from simbev_ros.foundation.cache.folders import ensure_folder
from simbev_ros.foundation.errors import NPZ_DAMAGE
from simbev_ros.foundation.process_limits import is_shortage
from simbev_ros.foundation.types import BoolArray, Int64Array
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.blueprints import VehicleFootprint, load_blueprints
from simbev_ros.scene.streets.off_tracking import TurnObstacles, bent_paths, is_long, too_tight

_FILE = "tight.npy"


def tight_lanes(network: RoadNetwork, following: Int64Array) -> Mapping[VehicleFootprint, BoolArray]:
    """For each long vehicle's footprint, (L,) driving lanes that it must not take.

    Args:
        network: The map.
        following: (K, 2) rows of driving lanes and their successors.

    Raises:
        InputError: The cache cannot be written.
    """
    bodies = sorted({each.turning_footprint for each in load_blueprints() if each.kind == "vehicle" and is_long(each)})
    driving, sidewalks = network.lanes_of(LaneKind.DRIVING), network.lanes_of(LaneKind.SIDEWALK)
    build = partial(_build, bodies, driving, sidewalks, following)
    cache_dir = network.net_path.parents[2]  # the net is in <cache>/<maps>/<map>
    while True:
        key = _cache_key(bodies, driving, sidewalks, following)
        folder = ensure_folder("turns", network.name, fingerprint(__name__), key, build, cache_dir)
        try:
            tight = np.load(folder / _FILE, allow_pickle=False)
            return dict(zip(bodies, tight.reshape(len(bodies), len(driving)), strict=True))
        except NPZ_DAMAGE as error:
            if is_shortage(error):
                raise
            discard_entry(folder)


def _build(
    bodies: Sequence[VehicleFootprint],
    driving: Sequence[Lane],
    sidewalks: Sequence[Lane],
    following: Int64Array,
    folder: Path,
) -> None:
    """Compute the tight lanes into a folder of the cache."""
    paths = bent_paths(driving, following)
    body, path = np.nonzero(too_tight(bodies, paths, TurnObstacles(driving, sidewalks)))
    tight = np.zeros((len(bodies), len(driving)), bool)
    tight[body, paths.decisive[path]] = True
    np.save(folder / _FILE, tight, allow_pickle=False)


def _cache_key(
    bodies: Sequence[VehicleFootprint], driving: Sequence[Lane], sidewalks: Sequence[Lane], following: Int64Array
) -> bytes:
    """Digest of everything that determines the content: the vehicles and the lanes."""
    lanes = (*driving, *sidewalks)
    named = json.dumps(
        [bodies, len(driving), [(lane.junction, lane.width_m, len(lane.centerline_m)) for lane in lanes]]
    )
    content = hashlib.sha256(named.encode())
    content.update(np.concatenate([np.empty((0, 3)), *(lane.centerline_m for lane in lanes)]).tobytes())
    content.update(following.tobytes())
    return content.digest()
