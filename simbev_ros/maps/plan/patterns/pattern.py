"""All patterns that a recipe can name, and how each draws itself."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator

from simbev_ros.maps.plan.draft import Draft
from simbev_ros.maps.plan.patterns import grid, motorway, region, road, roundabout, viaduct
from simbev_ros.random import stream

Pattern = Annotated[
    grid.Grid | road.Road | roundabout.Roundabout | motorway.Motorway | region.Region | viaduct.Viaduct,
    Discriminator("pattern"),
]

_DRAW: dict[str, Callable[[Any, Draft, np.random.Generator], None]] = {
    "grid": grid.draw,
    "road": road.draw,
    "roundabout": roundabout.draw,
    "motorway": motorway.draw,
    "region": region.draw,
    "viaduct": viaduct.draw,
}


def draw_patterns(patterns: Sequence[Pattern], name: str, seed: int) -> Draft:
    """The draft of a town; each pattern has random numbers of its own."""
    draft = Draft()
    for index, pattern in enumerate(patterns):
        _DRAW[pattern.pattern](pattern, draft, stream(seed, f"map.{name}.{index}.{pattern.pattern}"))
    return draft
