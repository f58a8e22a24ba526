"""The catalog: one model per blueprint. What is built once is then read from the cache."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache, partial
from pathlib import Path
from typing import Protocol, TypeVar

from simbev_ros.assets.actors.actor_model import ActorModel, CoarserMesh
from simbev_ros.assets.actors.model_file import read_coarser, read_models, write_coarser, write_models
from simbev_ros.assets.actors.shape import build_model, load_shape
from simbev_ros.assets.build_pool import build_in_processes
from simbev_ros.foundation.cache.entries import default_cache_dir, entry_path
from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.cache.fingerprint import fingerprint
from simbev_ros.foundation.errors import SimulationError
from simbev_ros.scene.blueprints import Blueprint, load_blueprints

_KIND = "models"
_EXACT, _COARSER = "exact.npz", "coarser.npz"
_R = TypeVar("_R")


@lru_cache(maxsize=1)
def load_models() -> tuple[ActorModel, ...]:
    """All models; a model's index is that of its blueprint, the ``blueprint`` column of the actors table.

    Raises:
        InputError: The cache cannot be written.
    """
    return _exact(map)


def build_models(*, coarser: bool) -> None:
    """Build the models that the cache lacks on all cores, which takes a minute: before any process waits for them.

    Args:
        coarser: Whether cameras need the coarser meshes as well.

    Raises:
        InputError: The cache cannot be written.
        SimulationError: A process was killed, as happens when memory runs out.
    """
    try:
        if not (_folder() / _EXACT).is_file():
            _exact(_map_in_processes)
        if coarser and not (_folder() / _COARSER).is_file():
            _coarser(_map_in_processes)
    except BrokenProcessPool:
        raise SimulationError("a process that built vehicles and people was killed; is there enough memory?") from None


class _Map(Protocol):
    """Calls a function for each item and returns the results in order, as ``map`` does."""

    def __call__(self, work: Callable[[Blueprint], _R], items: Sequence[Blueprint], /) -> Iterable[_R]: ...


def _map_in_processes(work: Callable[[Blueprint], _R], items: Sequence[Blueprint], /) -> list[_R]:
    results = dict(build_in_processes(work, items))
    return [results[index] for index in range(len(items))]


def _exact(mapped: _Map) -> tuple[ActorModel, ...]:
    blueprints = load_blueprints()

    def write(path: Path) -> None:
        write_models(path, list(mapped(_built, blueprints)))

    return read_cached(
        _folder() / _EXACT, _KIND, partial(read_models, blueprints=blueprints, coarser=_coarser_of), write
    )


def _coarser(mapped: _Map) -> list[tuple[CoarserMesh, ...]]:
    def write(path: Path) -> None:
        write_coarser(path, mapped(_built_coarser, load_blueprints()))

    return read_cached(_folder() / _COARSER, _KIND, read_coarser, write)


def _coarser_of(index: int) -> tuple[CoarserMesh, ...]:
    """The coarser meshes of one model; see ``ActorModel.build_coarser``."""
    return _all_coarser()[index]


@lru_cache(maxsize=1)
def _all_coarser() -> list[tuple[CoarserMesh, ...]]:
    return _coarser(map)


def _built(blueprint: Blueprint) -> ActorModel:
    return build_model(blueprint, load_shape(blueprint.name))


def _built_coarser(blueprint: Blueprint) -> tuple[CoarserMesh, ...]:
    return _built(blueprint).build_coarser()


def _folder() -> Path:
    return entry_path(default_cache_dir() / _KIND, "all", fingerprint(__name__), b"")
