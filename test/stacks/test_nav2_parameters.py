"""Nav2's parameters fit our ego, its sensors and its grid, and the page's merge keeps the defaults."""

import ast
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from guide_tables import ROOT, page

from simbev_ros.config.load import load_scenario
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints

FILE = ROOT / "config/nav2/nav2.yaml"
PARAMETERS: dict[str, Any] = yaml.safe_load(FILE.read_text())
COSTMAPS = {name: PARAMETERS[name][name]["ros__parameters"] for name in ("local_costmap", "global_costmap")}
SCENARIO = load_scenario(ROOT / "config/nav2/simbev.yaml")
FOLLOW = PARAMETERS["controller_server"]["ros__parameters"]["FollowPath"]
DEFAULTS = """
controller_server:
  ros__parameters:
    controller_frequency: 20.0
    FollowPath: {plugin: dwb_core::DWBLocalPlanner, vx_max: 0.5, time_steps: 56, critics: [A, B]}
amcl: {ros__parameters: {base_frame_id: base_footprint}}
"""


def test_printed_script_puts_our_parameters_over_the_defaults(tmp_path: Path) -> None:
    found = re.search(r"^python3 - \S+ (\S+) >params.yaml <<'EOF'\n(.*?)^EOF$", page("nav2"), re.DOTALL | re.MULTILINE)
    assert found is not None and ROOT / found[1] == FILE
    (tmp_path / "defaults.yaml").write_text(DEFAULTS)
    command = [sys.executable, "-", str(tmp_path / "defaults.yaml"), str(FILE)]
    text = subprocess.run(command, input=found[2], capture_output=True, text=True, check=True).stdout
    merged, expected = yaml.safe_load(text), yaml.safe_load(DEFAULTS)
    controller = merged["controller_server"]["ros__parameters"]
    assert controller["controller_frequency"] == 20.0 and merged["amcl"] == expected["amcl"]
    assert controller["FollowPath"] == {"time_steps": 56, "critics": ["A", "B"]} | FOLLOW
    assert all(merged[name] == PARAMETERS[name] for name in PARAMETERS if name != "controller_server")
    assert "&" not in text and "*" not in text  # rcl's parser of parameters knows no anchors


@pytest.mark.parametrize("name", COSTMAPS)
def test_the_footprint_is_the_ego_about_its_rear_axle(name: str) -> None:
    ego = load_blueprints()[blueprint_index()[SCENARIO.ego.blueprint]]
    length_m, width_m, _ = ego.size_m
    assert ego.wheelbase_m is not None
    ahead_m, behind_m = (length_m + ego.wheelbase_m) / 2.0, (ego.wheelbase_m - length_m) / 2.0
    corners = {(round(x, 9), round(y, 9)) for x in (ahead_m, behind_m) for y in (width_m / 2.0, -width_m / 2.0)}
    assert {tuple(corner) for corner in ast.literal_eval(COSTMAPS[name]["footprint"])} == corners


def test_the_frames_are_those_of_the_graph() -> None:
    named = re.findall(r"^ *(?:\w*_frame|\w*frame_id): (\S+)$", FILE.read_text(), re.MULTILINE)
    assert len(named) >= 9 and set(named) == {"map", "ego/odom", "ego/base_link"}
    assert SCENARIO.frames.odom and SCENARIO.frames.base_link == "rear_axle"


def test_nav2_drives_the_ego() -> None:
    assert SCENARIO.ego.driver == "twist"


def test_clouds_are_marked_as_far_as_they_clear_and_no_farther_than_the_lidar_reaches() -> None:
    (lidar,) = (sensor for sensor in SCENARIO.rig.sensors if sensor.type == "lidar")
    for costmap in COSTMAPS.values():
        for layer in costmap["plugins"]:
            if "cloud" in costmap[layer]:
                cloud = costmap[layer]["cloud"]
                assert cloud["topic"] == f"/ego/{lidar.name}/points"
                assert cloud["obstacle_max_range"] < cloud["raytrace_max_range"] <= lidar.range_m


def test_what_the_controller_predicts_stays_on_the_local_costmap() -> None:
    horizon_m = 56 * 0.05 * FOLLOW["vx_max"]  # Nav2's defaults of time_steps and model_dt
    assert horizon_m < COSTMAPS["local_costmap"]["width"] / 2.0


def test_the_relays_map_covers_the_costmaps() -> None:
    grid = SCENARIO.annotation.bev
    inside_m = min(grid.rows, grid.columns) * grid.cell_m / math.sqrt(2.0)
    assert all(costmap["width"] == costmap["height"] < inside_m for costmap in COSTMAPS.values())


def test_voxels_reach_over_the_highest_obstacle() -> None:
    layer = COSTMAPS["local_costmap"]["voxel_layer"]
    assert layer["origin_z"] + layer["z_voxels"] * layer["z_resolution"] >= layer["cloud"]["max_obstacle_height"]
    assert layer["z_voxels"] <= 16
