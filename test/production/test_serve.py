"""Orders of scenes are drawn as a dataset would draw them, and refused in one line."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from simbev_ros.config.load import parse_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.serve import OrderDrawer
from simbev_ros.ros.graph.scene_queue import SceneOrder

CONFIG = """
seed: 7
scenes: [{map: Blocks, train: 1, test: 1}]
time: {warm_up_s: 1, duration_s: 1}
rig: {sensors: [{type: gnss, name: gnss}]}
traffic: {vehicles: 5, pedestrians: 5, spawn_radius_m: 100}
"""


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return parse_scenario(CONFIG, "test.yaml")


@pytest.fixture
def drawer(scenario: Scenario) -> OrderDrawer:
    return OrderDrawer(scenario, None)


def test_scenes_without_a_number_follow_each_other_as_in_a_dataset(scenario: Scenario, drawer: OrderDrawer) -> None:
    drawn = [drawer.draw(SceneOrder())[1] for _ in range(3)]
    assert drawn[:2] == draw_scenes(scenario)
    assert (drawn[2].name, drawn[2].split, drawn[2].seed) == ("Blocks-0002", "train", 9)


def test_a_seed_without_a_number_means_scene_zero_of_that_seed(drawer: OrderDrawer) -> None:
    drawer.draw(SceneOrder(number=5))
    scenario, spec = drawer.draw(SceneOrder(seed=40))
    assert (spec.number, spec.seed, scenario.seed) == (0, 40, 40)
    assert drawer.draw(SceneOrder(seed=40))[1] == spec


def test_a_configuration_comes_as_text_as_a_name_or_as_a_file(drawer: OrderDrawer, tmp_path: Path) -> None:
    text = CONFIG.replace("vehicles: 5", "vehicles: 3")
    (tmp_path / "other.yaml").write_text(text)
    from_text, from_file = (drawer.draw(SceneOrder(each)) for each in (text, str(tmp_path / "other.yaml")))
    assert from_text[0] == from_file[0]
    assert from_text[0].traffic.vehicles == 3
    assert drawer.draw(SceneOrder("demo"))[0].rig.of_type is not None


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (SceneOrder("nonsense"), "nonsense: no such file; shipped configurations are"),
        (SceneOrder(CONFIG.replace("7", "many")), "configuration:2: seed: "),
        (SceneOrder("/etc/passwd"), "/etc/passwd: the name of a configuration file ends in .yaml or .yml"),
        (
            SceneOrder("rig: /etc/passwd\n"),
            "configuration:1: rig: must be a file that ends in .yaml or .yml, not '/etc",
        ),
        (SceneOrder("a: ["), "configuration: not valid YAML: "),
        (SceneOrder(CONFIG + "evaluation: {stack: [rm, -rf, x]}\n"), "evaluation: must be that of the configuration"),
        (SceneOrder(seed=-2), "seed -2: must be 0 or more"),
        (SceneOrder(number=-2), "number -2: must be 0 to "),
        (SceneOrder(number=10**12), "number 1000000000000: must be 0 to "),
        (SceneOrder("x" * (5 << 20) + ": "), "configuration: is longer than "),
    ],
)
def test_a_wrong_order_is_refused_in_words(drawer: OrderDrawer, order: SceneOrder, words: str) -> None:
    with pytest.raises(InputError, match=f"^{words}".replace("(", r"\(")):
        drawer.draw(order)


def test_clients_see_nothing_of_files_that_an_order_names(scenario: Scenario, tmp_path: Path) -> None:
    (tmp_path / "secret.yaml").write_text("password: tiger\n")
    (tmp_path / "rig.yaml").write_text("sensors: tiger\n")
    events: list[object] = []
    drawer = OrderDrawer(scenario, None, SimpleNamespace(notify=events.append))  # type: ignore[arg-type]
    text = CONFIG.replace("rig: {sensors: [{type: gnss, name: gnss}]}", f"rig: {tmp_path}/rig.yaml")
    for words in (str(tmp_path / "secret.yaml"), text):
        with pytest.raises(InputError, match=r"^configuration: a file that it names cannot be used; the graph's log"):
            drawer.draw(SceneOrder(words))
    assert [("password" in str(each), "tiger" in str(each)) for each in events] == [(True, False), (False, True)]


def test_an_order_needs_no_more_than_a_large_rig(drawer: OrderDrawer) -> None:
    camera = "{{type: camera, name: cam_{}, width_px: 8192, height_px: 8192}}"
    sensors = ", ".join(camera.format(number) for number in range(60))
    with pytest.raises(InputError, match=r"^rig: has 20,132,788,800 pixels, .* voxels; an order may have 268,435,456"):
        drawer.draw(SceneOrder(CONFIG.replace("{type: gnss, name: gnss}", sensors)))


VOXELS = "annotation: {occupancy: {half_side_m: 512, voxel_m: 0.5, bottom_m: -1, top_m: 15}}"


@pytest.mark.parametrize(
    ("count", "sensor", "more", "words"),
    [
        (257, "{{type: imu, name: imu_{}}}", "", "257 sensors; an order may have 256$"),
        (
            250,
            "{{type: radar, name: r_{}, rate_hz: 1, points_per_second: 1000000}}",
            VOXELS,
            "384,347,328 pixels, rays",
        ),
        (0, "", "agents: [{name: a, count: 31, annotation: {bev: {rows: 4096, columns: 4096}}}]", "520,223,296 pixels"),
        (0, "", f"agents: [{{name: a, count: 2, {VOXELS}}}]", "268,824,256 pixels, rays, cells and voxels"),
    ],
    ids=["sensors", "rays", "cells", "voxels"],
)
def test_an_order_needs_no_more_memory_by_many_sensors_or_large_labels(
    drawer: OrderDrawer, count: int, sensor: str, more: str, words: str
) -> None:
    sensors, more = (
        ", ".join(map(sensor.format, range(count))),
        more.replace("{name: a,", "{name: a, rig: {sensors: []},"),
    )
    with pytest.raises(InputError, match=rf"^rig: has {words}"):
        drawer.draw(SceneOrder(f"{CONFIG.replace('{type: gnss, name: gnss}', sensors)}\n{more}\n"))


def test_recorded_scenes_have_numbers_of_their_own(scenario: Scenario, tmp_path: Path) -> None:
    (tmp_path / "scenes" / "train" / "Blocks-0000").mkdir(parents=True)
    drawer = OrderDrawer(scenario, tmp_path)
    with pytest.raises(InputError, match=r"^number 0: .* has a scene with it; ask for another one or for none$"):
        drawer.draw(SceneOrder(number=0))
    drawn = [
        drawer.draw(order)[1]
        for order in (SceneOrder(seed=40), SceneOrder(seed=40), SceneOrder(), SceneOrder(number=9))
    ]
    assert [(spec.name, spec.seed) for spec in drawn] == [
        ("Blocks-0001", 40),
        ("Blocks-0002", 40),
        ("Blocks-0003", 10),
        ("Blocks-0009", 16),
    ]
    assert drawn[0].vehicles == OrderDrawer(scenario, None).draw(SceneOrder(seed=40))[1].vehicles
    with pytest.raises(InputError, match=r"^number 9: "):
        drawer.draw(SceneOrder(number=9))
