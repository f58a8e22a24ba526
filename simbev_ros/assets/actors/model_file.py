"""Reads and writes the catalog's models as files of flat arrays; damaged files raise ``errors.NPZ_DAMAGE``.

Files are mapped, so that all processes of a machine share one copy.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, fields
from functools import partial
from itertools import chain, islice
from pathlib import Path

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel, CoarserMesh, Cycle, Part
from simbev_ros.assets.mesh.mesh_arrays import mesh_arrays, meshes_from
from simbev_ros.foundation.files.mapped_arrays import map_arrays, write_arrays
from simbev_ros.scene.blueprints import Blueprint


def write_models(path: Path, models: Sequence[ActorModel]) -> None:
    """Write models, without their coarser meshes."""
    parts = json.dumps([[asdict(part) for part in model.parts] for model in models])
    cycles = {
        f"{field.name}.{index}": getattr(model.cycle, field.name)
        for index, model in enumerate(models)
        if model.cycle
        for field in fields(Cycle)
    }
    meshes = dict(mesh_arrays([model.mesh for model in models]))
    write_arrays(path, {"parts": np.array(parts), **meshes, **cycles})


def read_models(
    path: Path, blueprints: Sequence[Blueprint], coarser: Callable[[int], tuple[CoarserMesh, ...]]
) -> tuple[ActorModel, ...]:
    """Read the models of all blueprints; ``coarser`` returns a model's coarser meshes by its index."""
    arrays = map_arrays(path)
    parts, meshes = json.loads(str(arrays["parts"])), meshes_from(arrays)
    cycles = [
        Cycle(**{field.name: arrays[f"{field.name}.{index}"] for field in fields(Cycle)})
        if f"{fields(Cycle)[0].name}.{index}" in arrays
        else None
        for index in range(len(meshes))
    ]
    return tuple(
        ActorModel(
            blueprint=blueprint.name,
            tag=blueprint.tag,
            box_class=blueprint.box_class,
            mesh=mesh,
            size_m=blueprint.size_m,
            parts=tuple(Part(**entry | {"pivot_m": tuple(entry["pivot_m"])}) for entry in own),
            wheel_radius_m=blueprint.wheel_radius_m,
            cycle=cycle,
            build_coarser=partial(coarser, index),
        )
        for index, (blueprint, mesh, own, cycle) in enumerate(zip(blueprints, meshes, parts, cycles, strict=True))
    )


def write_coarser(path: Path, coarser: Iterable[Sequence[CoarserMesh]]) -> None:
    """Write the coarser meshes of all models."""
    models = list(coarser)
    levels = list(chain.from_iterable(models))
    counts, errors_m = np.array([len(each) for each in models]), np.array([level.error_m for level in levels])
    write_arrays(path, {"levels": counts, "error_m": errors_m, **dict(mesh_arrays([level.mesh for level in levels]))})


def read_coarser(path: Path) -> list[tuple[CoarserMesh, ...]]:
    """Read the coarser meshes of each model from a file that ``write_coarser`` wrote."""
    arrays = map_arrays(path)
    levels = map(CoarserMesh, meshes_from(arrays), arrays["error_m"].tolist())
    return [tuple(islice(levels, count)) for count in arrays["levels"].tolist()]
