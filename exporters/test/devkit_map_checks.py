"""Checks a map expansion with the nuscenes-devkit. Run by its own Python: DATAROOT FOLDER → JSON."""

import json
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import descartes
import numpy as np
import shapely
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from nuscenes import NuScenes
from nuscenes.map_expansion import map_api

RADIUS_M = 80.0


def polygon_patch(polygon, **options):
    """What descartes draws, which does not work with the devkit's Shapely."""
    parts = getattr(polygon, "geoms", [polygon])
    rings = [np.asarray(ring.coords)[:, :2] for part in parts for ring in (part.exterior, *part.interiors)]
    return PathPatch(Outline.make_compound_path(*[Outline(ring, closed=True) for ring in rings]), **options)


def drivable_area(nusc_map):
    """The whole drivable area."""
    tokens = [token for record in nusc_map.drivable_area for token in record["polygon_tokens"]]
    return shapely.union_all([nusc_map.extract_polygon(token) for token in tokens])


def path_error_m(nusc_map, tokens):
    """Maximum gap from the end of a path to the starts of the paths that follow."""
    ends = {token: np.array(poses)[[0, -1], :2] for token, poses in nusc_map.discretize_lanes(tokens, 0.5).items()}
    gaps = [
        np.linalg.norm(ends[token][1] - ends[following][0])
        for token in tokens
        for following in nusc_map.get_outgoing_lane_ids(token)
    ]
    return float(max(gaps))


def main():
    """Run all checks and write their results."""
    dataroot, folder = sys.argv[1], Path(sys.argv[2])
    descartes.PolygonPatch = polygon_patch
    nusc = NuScenes(version="v1.0-trainval", dataroot=dataroot, verbose=False)
    location = nusc.log[0]["location"]
    map_api.locations.append(location)
    nusc_map = map_api.NuScenesMap(dataroot=dataroot, map_name=location)
    poses = np.array([pose["translation"] for pose in nusc.ego_pose])
    x_m, y_m = poses[0, :2]
    layers = nusc_map.lookup_polygon_layers + nusc_map.non_geometric_line_layers
    near = nusc_map.get_records_in_radius(x_m, y_m, RADIUS_M, layers)
    lanes = [record["token"] for record in nusc_map.lane + nusc_map.lane_connector]
    middles = {token: path[len(path) // 2][:2] for token, path in nusc_map.discretize_lanes(lanes, 1.0).items()}
    polygons = [layer for layer in nusc_map.lookup_polygon_layers if layer != "drivable_area"]
    invalid = [
        layer
        for layer in polygons
        for record in getattr(nusc_map, layer)
        if not nusc_map.extract_polygon(record["polygon_token"]).is_valid
    ]
    sizes_m = (2 * RADIUS_M, 2 * RADIUS_M)
    geometry = nusc_map.get_map_geom((x_m, y_m, *sizes_m), 0, ["drivable_area", "walkway"])
    mask = nusc_map.explorer.map_geom_to_mask(geometry, (0, 0, *sizes_m), (160, 160))
    figure, _ = nusc_map.render_map_patch(
        (x_m - 60, y_m - 60, x_m + 60, y_m + 60), nusc_map.non_geometric_layers, figsize=(9, 9)
    )
    figure.savefig(folder / "expansion.png")
    area = drivable_area(nusc_map)
    found = {
        "near": {layer: len(tokens) for layer, tokens in near.items()},
        "invalid": invalid,
        "lanes": len(nusc_map.lane),
        "connectors": len(nusc_map.lane_connector),
        "found_at_their_middle": sum(
            nusc_map.record_on_point(*middles[record["token"]], "lane") == record["token"] for record in nusc_map.lane
        ),
        "closest": sum(nusc_map.get_closest_lane(*middles[token], radius=1) == token for token in lanes[:20]),
        "path_error_m": path_error_m(nusc_map, lanes),
        "ego_on_road": float(shapely.contains(area, shapely.points(poses[:, :2])).mean()),
        "mask_share": mask.mean(axis=(1, 2)).tolist(),
        "drivable_m2": area.area,
    }
    (folder / "found.json").write_text(json.dumps(found))


main()
