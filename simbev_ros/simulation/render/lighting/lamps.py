"""Lamps that are lit in a world state: position, direction and intensity, with the properties from lamps.yaml.

``VehicleLamps``, ``signal_lamps`` and ``street_lamps`` return ``LAMP_DTYPE`` rows, from which the lamp field and glare
are drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.materials import Material
from simbev_ros.foundation.on_demand import OnDemand
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.scene.state import Light, SignalState, map_from_actors

LAMP_DTYPE = np.dtype(
    [
        ("at", "<f4", 3),  # m, world
        ("facing", "<f4", 3),  # unit vector
        ("color", "<f4", 3),  # linear RGB
        ("glow", "<f4"),  # light on nearby surfaces
        ("reach_m", "<f4"),  # range of the glow
        ("glare_cd", "<f4"),  # luminous intensity as cameras see it
        ("forward", "<f4"),  # 0: shines all around, 1: only ahead
        ("height_m", "<f4"),  # above the ground
        ("beam", "u1"),  # 0: no headlamp, 1: low beam, 2: high beam
        ("row", "<i4"),  # row of its vehicle in the actors table, else -1
    ]
)
"""One row per lit lamp. World: the map frame translated to the frame's origin."""

_SIDE_M = 0.12  # a lamp nearer to the vehicle's center line than this is on the center line
_SIGNAL_FRONT_M, _SIGNAL_HEIGHT_M = 0.2, 5.0
_STREET_HEIGHT_M = 7.8


@lru_cache(maxsize=1)
def lamp_kinds() -> dict[str, dict[str, Any]]:
    """The content of lamps.yaml."""
    return load_table("simbev_ros.simulation.render.lighting", "lamps.yaml")


@dataclass(frozen=True, slots=True)
class _ModelLamps:
    """The lamps of one model: (L, 3) positions and colors in its frame, (L,) 1 front or -1 rear, and materials."""

    position_m: Float64Array
    color: Float64Array
    ahead: Float64Array
    material: Table


class VehicleLamps:
    """The lamps of all models of the catalog, found in their meshes."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare (B,) models, indexed by blueprint."""
        self._models = OnDemand(len(models), lambda blueprint: _find_lamps(models[blueprint]))

    def lit_lamps(self, actors: Table, origin_m: Float64Array) -> Table:
        """(N,) ``LAMP_DTYPE`` lit lamps of (A,) ``ACTOR_DTYPE`` rows, in a world around (3,) ``origin_m``."""
        poses = map_from_actors(actors)
        poses[:, :3, 3] -= origin_m
        parts = [np.zeros(0, LAMP_DTYPE)]
        for blueprint in np.unique(actors["blueprint"]).tolist():
            model = self._models[blueprint]
            selected = np.flatnonzero((actors["blueprint"] == blueprint) & (actors["lights"] != 0))
            free = np.ones((len(selected), len(model.material)), bool)
            for name, kind in lamp_kinds()["vehicle"].items():
                lit = (actors["lights"][selected] & Light[kind["light"]] != 0)[:, None]
                lit = lit & (model.material == Material[kind["material"]]) & free
                free &= ~lit
                index, lamp = np.nonzero(lit)
                rows = selected[index]
                lamps = _lamps_of_kind(len(rows), kind, model.color[lamp] if kind["color"] is None else kind["color"])
                lamps["at"] = (poses[rows, :3, :3] @ model.position_m[lamp, :, None])[..., 0] + poses[rows, :3, 3]
                lamps["height_m"] = model.position_m[lamp, 2]
                lamps["facing"] = poses[rows, :3, 0] * model.ahead[lamp, None]
                lamps["beam"] = {"low_beam": 1, "high_beam": 2}.get(name, 0)
                lamps["row"] = rows
                parts.append(lamps)
        return np.concatenate(parts)


def signal_lamps(signals: Table, origin_m: Float64Array) -> Table:
    """(N,) ``LAMP_DTYPE`` lit lamps of (S,) ``SIGNAL_DTYPE`` rows."""
    parts = [np.zeros(0, LAMP_DTYPE)]
    for kind in lamp_kinds()["signal"].values():
        lit = signals[np.isin(signals["state"], [SignalState[state] for state in kind["states"]])]
        lamps = _lamps_of_kind(len(lit), kind, kind["color"])
        lamps["facing"][:, :2] = np.stack([np.cos(lit["yaw"]), np.sin(lit["yaw"])], axis=1)
        center_m = np.stack([lit["x"], lit["y"], lit["z"] + kind["up_m"]], axis=1) - origin_m
        lamps["height_m"] = _SIGNAL_HEIGHT_M
        lamps["at"] = center_m + lamps["facing"] * _SIGNAL_FRONT_M
        parts.append(lamps)
    return np.concatenate(parts)


def street_lamps(lights_m: Float64Array, strengths: Float64Array) -> Table:
    """(N,) ``LAMP_DTYPE`` of (N, 3) lit street lights in the world; their light on the ground has a map of its own."""
    kind = lamp_kinds()["street"]
    lamps = np.zeros(len(lights_m), LAMP_DTYPE)
    lamps["at"], lamps["color"], lamps["row"] = lights_m, kind["color"], -1
    lamps["facing"] = (0.0, 0.0, -1.0)
    lamps["forward"], lamps["height_m"] = kind["forward"], _STREET_HEIGHT_M
    lamps["glare_cd"] = kind["glare_cd"] * strengths
    return lamps


def _lamps_of_kind(count: int, kind: dict[str, Any], color: Any) -> Table:
    """Lamps of one kind, without positions."""
    lamps = np.zeros(count, LAMP_DTYPE)
    for name in ("glow", "reach_m", "glare_cd", "forward"):
        lamps[name] = kind[name]
    lamps["color"], lamps["row"] = color, -1
    return lamps


def _find_lamps(model: ActorModel) -> _ModelLamps:
    """Find a model's lamps: the triangles of a material at the same end and side form one lamp."""
    mesh = model.mesh
    first = mesh.triangles[:, 0]
    selected = np.isin(mesh.material[first], [Material[k["material"]] for k in lamp_kinds()["vehicle"].values()])
    corners_m = mesh.vertices[mesh.triangles[selected]].astype(np.float64)
    center_m = corners_m.mean(axis=1)
    area = np.linalg.norm(np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0]), axis=1)
    side = np.where(np.abs(center_m[:, 1]) < _SIDE_M, 0.0, np.sign(center_m[:, 1]))
    ahead = np.where(center_m[:, 0] > 0.0, 1.0, -1.0)
    keys = np.column_stack([mesh.material[first[selected]], side, ahead])
    lamps, member = np.unique(keys, axis=0, return_inverse=True)
    share = (member.reshape(-1) == np.arange(len(lamps))[:, None]) * (area + 1e-12)
    share /= share.sum(axis=1, keepdims=True)
    color = share @ (mesh.color[first[selected]] / 255.0) ** 2.2
    return _ModelLamps(
        position_m=share @ center_m,
        color=color / np.maximum(color.max(axis=1, keepdims=True, initial=1e-6), 1e-6),
        ahead=lamps[:, 2],
        material=lamps[:, 0].astype(np.uint8),
    )
