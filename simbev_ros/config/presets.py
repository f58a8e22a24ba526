"""Presets of sensors: tables of manufacturers' models, whose values a sensor has unless it gives others."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal

from simbev_ros.foundation.tables import load_table

Kind = Literal["camera", "lidar", "radar"]


@lru_cache
def load_presets(kind: Kind) -> dict[str, dict[str, Any]]:
    """Load the table of a kind of sensor: properties by model name."""
    return load_table("simbev_ros.config", f"{kind}_presets.yaml")


def preset_of(kind: Kind, data: Mapping[str, Any]) -> dict[str, Any]:
    """Properties of the preset that a sensor's data name; empty if they name none that is known."""
    name = data.get("preset")
    return load_presets(kind).get(name, {}) if isinstance(name, str) else {}


def filled_in(data: Mapping[str, Any], preset: Mapping[str, Any]) -> dict[str, Any]:
    """Data of a sensor with the values of a preset where they give none, also within sections such as ``receiver``."""
    merged = {**preset, **data}
    for name in preset.keys() & data.keys():
        if isinstance(preset[name], dict) and isinstance(data[name], dict):
            merged[name] = {**preset[name], **data[name]}
    return merged


def require_known(kind: Kind, name: str | None) -> None:
    """Raise a ``ValueError`` if a sensor names a preset that is not in its kind's table."""
    if name is not None and name not in load_presets(kind):
        raise ValueError(f"preset {name!r} is not known; allowed: {', '.join(load_presets(kind))}")
