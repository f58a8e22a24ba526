"""The catalog: one model per blueprint. What is built once is then read from the cache."""

from collections.abc import Iterator
from functools import lru_cache, partial
from pathlib import Path

from simbev_ros.assets.actors.actor_model import ActorModel, CoarserMesh
from simbev_ros.assets.actors.model_file import read_coarser, read_models, write_coarser, write_models
from simbev_ros.assets.actors.shape import build_model, load_shape
from simbev_ros.foundation.cache.entries import default_cache_dir, entry_path
from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.cache.fingerprint import fingerprint
from simbev_ros.scene.blueprints import load_blueprints

_KIND = "models"
_EXACT, _COARSER = "exact.npz", "coarser.npz"


@lru_cache(maxsize=1)
def load_models() -> tuple[ActorModel, ...]:
    """All models; a model's index is that of its blueprint, the ``blueprint`` column of the actors table.

    Raises:
        InputError: The cache cannot be written.
    """
    read = partial(read_models, blueprints=load_blueprints(), coarser=_coarser)
    return read_cached(_folder() / _EXACT, _KIND, read, lambda path: write_models(path, tuple(_built())))


def build_models(*, coarser: bool) -> None:
    """Build the models that the cache lacks, which takes minutes: before any process has others wait for it.

    Args:
        coarser: Whether cameras need the coarser meshes as well.
    """
    if not (_folder() / _EXACT).is_file():
        load_models()
    if coarser and not (_folder() / _COARSER).is_file():
        _all_coarser()


def _coarser(index: int) -> tuple[CoarserMesh, ...]:
    """The coarser meshes of one model; see ``ActorModel.build_coarser``."""
    return _all_coarser()[index]


@lru_cache(maxsize=1)
def _all_coarser() -> list[tuple[CoarserMesh, ...]]:
    def write(path: Path) -> None:
        write_coarser(path, (model.build_coarser() for model in _built()))

    return read_cached(_folder() / _COARSER, _KIND, read_coarser, write)


def _built() -> Iterator[ActorModel]:
    return (build_model(blueprint, load_shape(blueprint.name)) for blueprint in load_blueprints())


def _folder() -> Path:
    return entry_path(default_cache_dir() / _KIND, "all", fingerprint(__name__), b"")
