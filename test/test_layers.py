"""The house has floors: imports point upward in the list, and each foreign library has its rooms."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "simbev_ros"
TRAINING, EXPORTERS = (PACKAGE.parent / f"{name}/simbev_{name}" for name in ("training", "exporters"))
FLOORS = [
    {"foundation", "__init__"},
    {"config"},
    {"schema"},
    {"recording", "maps"},
    {"dataset", "scene", "drawing"},
    {"assets"},
    {"simulation"},
    {"export"},
    {"evaluation"},
    {"reference_stack", "join"},
    {"ros"},
    {"baselines"},
    {"production"},
    {"show"},
    {"cli"},
]
DATA = {"foundation", "config", "schema", "recording", "dataset"}
"""Reading, checking and planning data needs these alone: neither maps nor anything of the simulator."""
ALONE = {"reference_stack": ("foundation.tick_join", "foundation.installation.shell_variables"), "join": ()}
"""Import nothing of the house, not even from above, but for these modules."""
ROS = {
    "ackermann_msgs",
    "autoware_control_msgs",
    "autoware_perception_msgs",
    "autoware_vehicle_msgs",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "sensor_msgs",
    "simbev_interfaces",
    "simulation_interfaces",
    "std_msgs",
    "std_srvs",
    "trajectory_msgs",
    "unique_identifier_msgs",
    "tf2_msgs",
    "vision_msgs",
    "visualization_msgs",
}
STACK = tuple(f"reference_stack/{module}" for module in ("messages", "node", "cooperative"))
BASELINES = tuple(f"baselines/{folder}/{module}" for folder in ("node", "driving") for module in ("node", "__main__"))
RELAY = tuple(f"show/foxglove/{module}" for module in ("graph_relay", "graph_server", "relayed_topics"))
LIVE = ("show/rerun/live/graph_reader", "show/rerun/live/live_viewer")
"""The node that the viewer reads a running graph with."""
HOMES = {
    **dict.fromkeys(ROS, ("ros", "join", *LIVE, *RELAY, *STACK, *BASELINES)),
    "moderngl": ("simulation/render",),
    "open3d": ("simulation/raycast",),
    "libsumo": ("simulation/world/sumo/traffic", "simulation/world/sumo/libsumo_import"),
    "rich": ("cli", "recording/bag_files", "show/pages/scene_figures", "show/pages/scene_page"),
    "rerun": ("show/rerun",),
    "foxglove": ("show/foxglove",),
    "typer": ("cli",),
    "torch": ("dataset/torch_dataset",),
    **dict.fromkeys(("onnx", "simbev_training", "simbev_exporters"), ()),
}
HOMES_IN_TRAINING = {
    **dict.fromkeys(ROS, ()),
    **dict.fromkeys(("torch", "onnx"), ("model", "training", "cli/train")),
    **dict.fromkeys(("typer", "rich", "simbev_ros.cli"), ("cli",)),
}
HOMES_IN_EXPORTERS = {
    **dict.fromkeys((*ROS, "torch", "onnx"), ()),
    **dict.fromkeys(("typer", "rich", "simbev_ros.cli"), ("cli",)),
}


def _imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module or ""


def _room(parts: tuple[str, ...]) -> str:
    return parts[0].removesuffix(".py")


def _floor(room: str) -> int:
    return next(index for index, rooms in enumerate(FLOORS) if room in rooms)


MODULES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", MODULES, ids=[str(path.relative_to(PACKAGE)) for path in MODULES])
def test_imports_point_upward_and_foreign_libraries_stay_in_their_rooms(path: Path) -> None:
    parts = path.relative_to(PACKAGE).parts
    room = _room(parts)
    for module in _imports(path):
        top, *rest = module.split(".")
        if top == "simbev_ros" and rest:
            assert _floor(rest[0]) <= _floor(room), f"imports {module}, which is on a later floor"
            assert room not in DATA or rest[0] in DATA, f"imports {module}; {room} reads data without the simulator"
            is_known = rest[0] == room or ".".join(rest) in ALONE.get(room, ())
            assert room not in ALONE or is_known, f"imports {module}; {room} knows only itself"
        elif top in HOMES:
            place = "/".join(parts)
            assert place.startswith(HOMES[top]), f"imports {module}; its home is {HOMES[top]}"


@pytest.mark.parametrize(("folder", "homes"), [(TRAINING, HOMES_IN_TRAINING), (EXPORTERS, HOMES_IN_EXPORTERS)])
def test_libraries_stay_in_their_rooms_of_the_other_distributions(
    folder: Path, homes: dict[str, tuple[str, ...]]
) -> None:
    for path in folder.rglob("*.py"):
        place = path.relative_to(folder).as_posix()
        for module in _imports(path):
            for name in {module.split(".")[0], ".".join(module.split(".")[:2])} & homes.keys():
                assert place.startswith(homes[name]), f"{place} imports {module}"


def test_every_package_has_a_floor() -> None:
    rooms = {_room(path.relative_to(PACKAGE).parts) for path in MODULES}
    assert rooms == set().union(*FLOORS)


def test_the_architecture_page_lists_these_floors() -> None:
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?:\d+|–) \| (`[^|]*`) \|", page, re.MULTILINE)
    assert [set(re.findall(r"`(\w+)`", row)) for row in rows] == [floor - {"__init__"} for floor in FLOORS]
