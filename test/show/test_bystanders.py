"""Tests of the actors in street pictures: cars in their lanes, pedestrians on sidewalks, none close to the camera."""

import numpy as np
import shapely
import shapely.affinity

from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import map_spec
from simbev_ros.show.street.street_traffic import bystanders


def test_cars_are_in_lanes_and_pedestrians_on_sidewalks() -> None:
    network = load_network(map_spec("Blocks"))
    position_m = network.waypoints(20.0).position_m[30]
    table = bystanders(network, position_m, 2)
    people = table["tag"] == Tag.PEDESTRIAN
    assert people.sum() > 5 and (~people).sum() > 5
    xy_m = np.stack([table["x"], table["y"]], axis=1)
    assert np.hypot(*(xy_m - position_m[:2]).T).min() > 14.0
    cars = table[~people]
    nearest = network.nearest_lane(xy_m[~people], cars["yaw"].astype(float))
    np.testing.assert_allclose(nearest.position_m[:, :2], xy_m[~people], atol=0.05)
    assert np.cos(nearest.yaw_rad - cars["yaw"]).min() > 0.99
    assert shapely.contains_xy(surfaces_of(network.layout).sidewalk, xy_m[people]).all()
    boxes = [
        shapely.affinity.translate(
            shapely.affinity.rotate(shapely.box(-a / 2, -b / 2, a / 2, b / 2), yaw, origin=(0, 0), use_radians=True),
            x,
            y,
        )
        for x, y, yaw, a, b in zip(*(cars[name] for name in ("x", "y", "yaw", "length", "width")), strict=True)
    ]
    assert len(shapely.STRtree(boxes).query(boxes, predicate="intersects")[0]) == len(boxes), "each touches itself only"
    assert table["id"].tolist() == list(range(2, 2 + len(table)))
    assert bystanders(network, position_m, 2).tobytes() == table.tobytes()
