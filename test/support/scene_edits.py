"""The ego in specifications of scenes that nobody has drawn."""

from collections.abc import Iterable, Mapping
from typing import Any

from simbev_ros.schema.scene.spec import SceneSpec


def ego(sensors: Iterable[Any] = (), annotation: Mapping[str, Any] | None = None, **others: Any) -> dict[str, Any]:
    """Fields of the ego, the first of a scene's ``agents``."""
    return {"rig": {"sensors": sensors}, "annotation": annotation or {}, "vehicle": 0} | others


def with_ego(spec: SceneSpec, **changes: Any) -> SceneSpec:
    """The scene with other fields of its ego."""
    first, *others = spec.agents
    return spec.model_copy(update={"agents": (first.model_copy(update=changes), *others)})
