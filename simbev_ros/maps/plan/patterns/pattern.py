"""Registry of all patterns that a town recipe can name, with their drawing functions."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator

from simbev_ros.foundation.random import stream
from simbev_ros.maps.plan.draft import Draft
from simbev_ros.maps.plan.patterns import grid, motorway, region, road, roundabout, viaduct

Pattern = Annotated[
    grid.Grid | road.Road | roundabout.Roundabout | motorway.Motorway | region.Region | viaduct.Viaduct,
    Discriminator("pattern"),
]

_DRAW: dict[str, Callable[[Any, Draft, np.random.Generator], None]] = {
    "grid": grid.draw_grid,
    "road": road.draw_road,
    "roundabout": roundabout.draw_roundabout,
    "motorway": motorway.draw_motorway,
    "region": region.draw_region,
    "viaduct": viaduct.draw_viaduct,
}


def draw_patterns(patterns: Sequence[Pattern], name: str, seed: int) -> Draft:
    """Draw the draft of a town; each pattern has a random stream of its own."""
    draft = Draft()
    for index, pattern in enumerate(patterns):
        _DRAW[pattern.pattern](pattern, draft, stream(seed, f"map.{name}.{index}.{pattern.pattern}"))
    return draft
