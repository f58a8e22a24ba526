"""The catalogue: one model per blueprint."""

from functools import lru_cache

from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.assets.actors.shape import build_model, load_shape
from simbev_ros.scene.blueprints import load_blueprints


@lru_cache(maxsize=1)
def load_models() -> tuple[ActorModel, ...]:
    """All models; a model's index is that of its blueprint, the ``blueprint`` column of the actors table."""
    return tuple(build_model(blueprint, load_shape(blueprint.name)) for blueprint in load_blueprints())
