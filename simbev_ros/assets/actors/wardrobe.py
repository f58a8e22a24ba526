"""People on foot, composed of a body, an outfit, a head and what they carry, as the name of their blueprint says."""

from typing import Any

from simbev_ros.assets.actors.body import load_body
from simbev_ros.foundation.tables import load_table


def composed_figure(blueprint: str) -> dict[str, Any] | None:
    """Fields of the ``Figure`` of a blueprint such as ``pedestrian.woman.coat.long.backpack``; None: another name.

    Raises:
        KeyError: wardrobe.yaml has no such body, outfit, head or thing to carry.
    """
    _, *words = blueprint.split(".")
    if len(words) < 3:
        return None
    groups: dict[str, dict[str, Any]] = load_table("simbev_ros.assets.actors", "wardrobe.yaml")
    groups["heads"] = {name: {"hairstyle": name} for name in load_body().hairstyles} | groups["heads"]
    figure: dict[str, Any] = {}
    for group, word in zip(("bodies", "outfits", "heads", "carried"), words, strict=False):
        figure |= groups[group][word]
    return figure
