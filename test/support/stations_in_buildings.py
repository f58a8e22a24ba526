"""Roadside units at poses inside buildings."""

from pathlib import Path

import numpy as np

from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import regions_of
from simbev_ros.schema.scene.map_spec import MapSpec

TEXT = """scenes: [{{map: {town}, train: 1}}]
time: {{warm_up_s: 1, duration_s: 1}}
rig: {{sensors: []}}
traffic: {{vehicles: 2, pedestrians: 2}}
agents:
  - name: rsu
    rig: {{sensors: []}}
    mast:
      poses:
        - {{{pose}}}
"""


def point_in_building_m(town: str) -> tuple[float, float, float]:
    """Position in plan of a point in a building of a town, map frame, and a height above all buildings around."""
    spec = MapSpec(name=town)
    network = load_network(spec)
    for region in regions_of(network.layout):
        for tile in StaticCache(spec, network).region(region).tiles:
            triangles = tile.mesh.triangles[tile.mesh.triangle_tag == Tag.BUILDING]
            corners_m = tile.mesh.vertices[triangles].astype(np.float64) + tile.origin_m
            area_m2 = np.abs(np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])[:, 2])
            if area_m2.max(initial=0.0) > 20.0:
                x_m, y_m, _ = corners_m[area_m2.argmax()].mean(axis=0).tolist()
                return x_m, y_m, float(corners_m[:, :, 2].max())
    raise AssertionError(f"{town} has no buildings")


def configuration_of(folder: Path, town: str, pose: str) -> Path:
    """A configuration whose line 10 is a pose of a roadside unit."""
    path = folder / "my.yaml"
    path.write_text(TEXT.format(town=town, pose=pose), encoding="utf-8")
    return path
