"""Road cross-sections by name: a recipe gives a class of the table, a class with changes, or all fields."""

from functools import lru_cache
from typing import Annotated, Any

from pydantic import BeforeValidator

from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.plan.draft import RoadClass


@lru_cache(maxsize=1)
def road_classes() -> dict[str, RoadClass]:
    """Load the table of road classes."""
    return {name: RoadClass(**entry) for name, entry in load_table("simbev_ros.maps.plan", "road_classes.yaml").items()}


def _resolve_name(value: Any) -> Any:
    """Resolve a class that is given as ``street`` or as ``{like: street, lanes: 2}``."""
    if isinstance(value, str):
        return _look_up(value)
    if isinstance(value, dict) and "like" in value:
        changes = {name: entry for name, entry in value.items() if name != "like"}
        return {**_look_up(value["like"]).model_dump(), **changes}
    return value


def _look_up(name: Any) -> RoadClass:
    if name not in road_classes():
        raise ValueError(f"no road class is called {name!r}; known: {', '.join(road_classes())}")
    return road_classes()[name]


NamedRoadClass = Annotated[RoadClass, BeforeValidator(_resolve_name)]
"""``street``, ``{like: street, lanes: 2}``, or all fields of a RoadClass."""
