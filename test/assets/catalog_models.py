"""Access to the catalog's models for tests, with vertices in any pose."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.skeletons import part_poses
from simbev_ros.assets.actors.variants import load_variants
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, blueprint_named, load_blueprints
from simbev_ros.schema.scene.state import ACTOR_DTYPE

PEDESTRIANS = [entry for entry in load_blueprints() if entry.kind == "pedestrian"]
ON_FOOT = [entry.name for entry in PEDESTRIANS if entry.on_foot]
GAIT = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)


def model(name: str) -> ActorModel:
    return load_models()[blueprint_index()[name]]


def blueprint(name: str) -> Blueprint:
    return blueprint_named(name)


def rows(count: int, **fields: object) -> Table:
    actors = np.zeros(count, ACTOR_DTYPE)
    for field, value in fields.items():
        actors[field] = value
    return actors


def pose_vertices(of: ActorModel, actors: Table, part: str | None = None) -> Float64Array:
    """(N, V, 3) vertices of (N,) actors, actor frame, of one part or of all."""
    chosen = np.ones(len(of.mesh.part), bool)
    if part is not None:
        chosen = of.mesh.part == [entry.name for entry in of.parts].index(part)
    poses = part_poses(of, actors)[:, of.mesh.part[chosen]]
    return np.einsum("nvij,vj->nvi", poses[..., :3, :3], of.mesh.vertices[chosen]) + poses[..., :3, 3]


def few_derived(names: Sequence[str]) -> list[Any]:
    """Parameters of a test: names of blueprints, of which most that are composed of tables need --all."""
    derived = [name for name in names if name in load_variants()["shapes"] or name.count(".") > 2]
    slow = {name for number, name in enumerate(derived) if number % 8}
    return [pytest.param(name, marks=pytest.mark.slow) if name in slow else name for name in names]
