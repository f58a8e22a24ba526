"""Trees and bushes on the land: gardens, parks, courtyards, woods."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.claims import Claims
from simbev_ros.assets.ground import LAND_HEIGHT_M
from simbev_ros.assets.plants import Grove, thicket
from simbev_ros.assets.tiles import TileBuilder, standing
from simbev_ros.assets.town_plan import Block, BlockUse, TownPlan
from simbev_ros.random import stream

_FROM_STREET_M = 1.2
_WOODS_DEPTH_M = 60.0
_BELT_INSET_M, _BELT_SPACING_M = 14.0, 15.0
_M2_PER_PLANT = {
    BlockUse.PARK: 95.0,
    BlockUse.RESIDENTIAL: 230.0,
    BlockUse.DOWNTOWN: 200.0,
    BlockUse.OUTSKIRTS: 420.0,
}
_KINDS = {
    BlockUse.PARK: ("round", "round", "tall", "small", "bush", "bush", "conifer"),
    BlockUse.RESIDENTIAL: ("round", "small", "small", "bush", "bush", "conifer"),
    BlockUse.DOWNTOWN: ("round", "small", "bush"),
    BlockUse.OUTSKIRTS: ("round", "tall", "conifer", "conifer", "bush"),
}
_ROOM_M = {"round": 2.4, "tall": 2.0, "small": 1.5, "conifer": 2.6, "bush": 0.8}


def plant_land(tiles: TileBuilder, claims: Claims, plan: TownPlan, density: float, seed: int) -> None:
    """Add plants where there is room. ``density``: 0 none, 1 lush."""
    rng = stream(seed, "surroundings.plants")
    grove = Grove(rng)
    for block in plan.blocks:
        _plant_block(tiles, claims, block, grove, density, rng)
    belt = shapely.box(*plan.ground.lawn.bounds).buffer(-_BELT_INSET_M, join_style="mitre").boundary
    for s_m in np.arange(0.0, belt.length, _BELT_SPACING_M):
        place = shapely.line_interpolate_point(belt, s_m)
        shift = rng.uniform(-3.0, 3.0, 2)
        tiles.place(thicket(rng), standing((place.x + shift[0], place.y + shift[1]), LAND_HEIGHT_M))


def _plant_block(
    tiles: TileBuilder, claims: Claims, block: Block, grove: Grove, density: float, rng: np.random.Generator
) -> None:
    """Plants at random places that are free; in the outskirts only near the town."""
    ground: BaseGeometry = block.land.buffer(-_FROM_STREET_M)
    if block.use is BlockUse.OUTSKIRTS:
        town = shapely.union_all([shapely.Polygon(ring) for ring in block.frontage])
        ground = ground.intersection(town.buffer(_WOODS_DEPTH_M))
    x0, y0, x1, y1 = ground.bounds
    places = rng.uniform((x0, y0), (x1, y1), (int(density * (x1 - x0) * (y1 - y0) / _M2_PER_PLANT[block.use]), 2))
    kinds = _KINDS[block.use]
    for place in places[shapely.contains_xy(ground, places)]:
        kind = kinds[int(rng.integers(len(kinds)))]
        if claims.claim(shapely.Point(*place).buffer(_ROOM_M[kind], quad_segs=4)):
            tiles.place(*grove.plant(kind, np.array([*place, LAND_HEIGHT_M])))
