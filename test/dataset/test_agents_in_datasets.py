"""A recorded scene with several agents is read as any of them sees it; made up: ego, car and a roadside unit, rsu."""

import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
from made_up_scene import SENSORS, MadeUp, boxes, made_up_scene, made_up_spec, record_made_up
from scene_edits import with_ego
from several_agents import MAST_SENSORS, car, made_up_agents, roadside_unit, with_agents

from simbev_ros.dataset import Dataset, Frame, Scene, open_dataset
from simbev_ros.dataset.index_row import index_row
from simbev_ros.dataset.statistics import statistics_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import AnyArray
from simbev_ros.recording.layout import scene_folder
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.spec import SceneSpec

SPEC = made_up_agents()
NOISE = boxes(np.random.default_rng(7), 5)
JOINT = {"/world/boxes": NOISE, "/prediction/boxes": NOISE, "/robot_description": NOISE}
"""Topics that are about all agents, or about the first one without its name."""


def equal(a: AnyArray, b: AnyArray) -> bool:
    """Whether two arrays, which may hold NaN, have the same bytes."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MadeUp]:
    """A bag, and what is in it."""
    path = tmp_path_factory.mktemp("agents") / SPEC.name
    return path, record_made_up(path, SPEC, tables=JOINT)


@pytest.fixture
def scene(made: tuple[Path, MadeUp]) -> Scene:
    return open_dataset(made[0]).scenes[0]


def test_a_scene_is_read_as_its_first_agent_sees_it(made: tuple[Path, MadeUp], scene: Scene) -> None:
    assert (scene.agent, scene.agents) == ("ego", ("ego", "car", "rsu"))
    assert (scene.spec, scene.of_agent("ego")) == (SPEC, scene)
    assert equal(scene[1]["boxes"], made[1].ticks[1]["boxes"])


def test_keys_of_an_agent_lack_its_name_and_those_of_the_others_have_theirs(scene: Scene) -> None:
    own = {"odom", "boxes", "lidar/points", "cam_front/rgb"}
    other = {"rsu/lidar/points", "rsu/boxes", "rsu/odom", "rsu/cam/depth"}
    world = {"world/actors", "world/boxes"}
    assert own | other | world | {"car/lidar/points", "prediction/boxes", "robot_description"} <= set(scene.keys)
    seen_by_car = set(scene.of_agent("car").keys)
    assert own | other | world | {"ego/lidar/points"} <= seen_by_car
    assert {"ego/prediction/boxes", "ego/robot_description"} <= seen_by_car
    assert not {"prediction/boxes", "robot_description", "car/odom"} & seen_by_car, "they are the first agent's"
    assert len(scene.keys) == len(seen_by_car)


@pytest.mark.parametrize("name", ["car", "rsu"])
def test_a_frame_has_the_values_of_its_agent(made: tuple[Path, MadeUp], scene: Scene, name: str) -> None:
    view = agent_view(SPEC, name)
    seen = scene.of_agent(name)
    assert (seen.agent, seen.agents, len(seen)) == (name, scene.agents, len(scene))
    assert (seen.view.rig, seen.view.ego_id) == (view.rig, view.ego_id)
    assert list(seen.calibration) == [sensor.name for sensor in view.rig.sensors]
    for frame, expected in zip(seen, made[1].others[name], strict=True):
        for key in ("boxes", "bev/labels", "lidar/points"):
            assert equal(frame[key], expected[key])
        map_from_agent = matrices_from_xyz_rpy(*expected["odom"])
        np.testing.assert_allclose(frame.map_from_ego, map_from_agent, rtol=0, atol=1e-12)
        in_map = map_from_agent @ view.rig.sensors[1].pose.ego_from_sensor
        np.testing.assert_allclose(frame.map_from_sensor(view.rig.sensors[1].name), in_map, rtol=0, atol=1e-12)


def test_other_agents_frames_are_those_of_the_same_tick(made: tuple[Path, MadeUp], scene: Scene) -> None:
    frame = scene[2]
    assert list(frame.others) == ["car", "rsu"]
    assert list(frame.others["rsu"].others) == ["ego", "car"]
    for name, other in frame.others.items():
        assert (other.tick, other.stamp_ns, other.scene.agent) == (2, frame.stamp_ns, name)
        assert equal(other["boxes"], made[1].others[name][2]["boxes"])
        assert equal(other["boxes"], frame[f"{name}/boxes"])
    assert equal(other.others["ego"]["odom"], frame["odom"])


def test_agents_share_the_opened_bag(scene: Scene) -> None:
    seen = scene.of_agent("car")
    assert seen.of_agent("ego") is scene and seen.of_agent("rsu") is scene.of_agent("rsu")
    assert seen.sources["boxes"].bag is scene.sources["boxes"].bag


def test_an_agents_motion_is_that_of_its_ego_frame_from_every_view(tmp_path: Path) -> None:
    behind = car("car", 2) | {"frames": {"base_link": "rear_axle"}, "base_link_x_m": -1.4}
    made = record_made_up(tmp_path / SPEC.name, with_agents(made_up_spec(SENSORS, number=2), behind))
    scene = open_dataset(tmp_path / SPEC.name).scenes[0]
    frame, (position_m, rpy_rad) = scene.of_agent("car")[1], made.others["car"][1]["odom"]
    expected_m = position_m + matrices_from_xyz_rpy(position_m, rpy_rad)[:3, 0] * 1.4
    np.testing.assert_allclose(frame.map_from_ego[:3, 3], expected_m, rtol=0, atol=1e-12)
    assert equal(frame["odom"], scene[1]["car/odom"])
    np.testing.assert_array_equal(scene[1].map_from_ego[:3, 3], made.ticks[1]["odom"][0])


def test_an_unknown_agent_is_named_with_those_that_there_are(scene: Scene) -> None:
    with pytest.raises(KeyError, match="Blocks-0002: no agent 'bus'; there are: ego, car, rsu"):
        scene.of_agent("bus")
    with pytest.raises(InputError, match="agent: no scene has 'bus', but car, ego, rsu"):
        open_dataset(scene.path).frames(agent="bus")


def test_scenes_frames_and_datasets_can_be_pickled_for_any_agent(scene: Scene) -> None:
    seen = scene.of_agent("rsu")
    frame = seen[1]
    copies: tuple[Scene, Frame] = pickle.loads(pickle.dumps((seen, frame)))
    assert len(pickle.dumps(seen)) < 2000
    assert copies[0].agent == copies[1].scene.agent == "rsu"
    assert equal(copies[1]["boxes"], frame["boxes"])
    assert equal(copies[0].of_agent("ego")[1]["boxes"], scene[1]["boxes"])


def test_a_bag_that_was_cut_off_is_read_for_every_agent(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    cut = Path(shutil.copytree(made[0], tmp_path / SPEC.name))
    (file,) = cut.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-400])  # the end of the file, with its index
    scene = open_dataset(cut).scenes[0].of_agent("rsu")
    assert scene.is_cut_off and scene.of_agent("car").is_cut_off
    assert equal(scene[0]["boxes"], made[1].others["rsu"][0]["boxes"])


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene with one agent, one with ego and car, and one with ego, car and rsu."""
    path = tmp_path_factory.mktemp("dataset")
    made_up_scene(scene_folder(path, "train", "Blocks-0000"))
    further = car("car", 2), roadside_unit()
    for number in (1, 2):
        spec = with_agents(made_up_spec(SENSORS, number=number), *further[:number])
        record_made_up(scene_folder(path, "train", spec.name), spec, tables=JOINT)
    return path


@pytest.mark.parametrize(
    ("agent", "scenes"),
    [
        (None, ["Blocks-0000", "Blocks-0001", "Blocks-0002"]),
        ("ego", ["Blocks-0000", "Blocks-0001", "Blocks-0002"]),
        ("car", ["Blocks-0001", "Blocks-0002"]),
        ("rsu", ["Blocks-0002"]),
    ],
)
def test_frames_of_an_agent_are_those_of_the_scenes_that_have_it(
    dataset: Path, agent: str | None, scenes: list[str]
) -> None:
    frames = open_dataset(dataset).frames(agent=agent, keys=["boxes"], every=3)
    assert [frame.scene.name for frame in frames] == scenes
    assert {frame.scene.agent for frame in frames} == {agent or "ego"}


def test_keys_are_looked_for_among_those_of_the_agent(dataset: Path) -> None:
    opened: Dataset = open_dataset(dataset)
    assert len(opened.frames(agent="rsu", keys=["cam/rgb"])) == SPEC.ticks
    with pytest.raises(InputError, match=r"keys: no scene has 'cam_front/rgb'; Blocks-0002 has .*ego/cam_front/rgb"):
        opened.frames(agent="rsu", keys=["cam_front/rgb"])


def test_the_index_describes_the_first_agent_alone(tmp_path: Path) -> None:
    rows = []
    for name, spec in (("one", made_up_spec(SENSORS, number=2)), ("three", SPEC)):
        bag = scene_folder(tmp_path / name, spec.split, spec.name)
        record_made_up(bag, spec, tables=JOINT)
        rows.append(index_row(bag, tmp_path / name))
    differing = {key for key, value in rows[0].items() if rows[1][key] != value}
    assert rows[0].keys() == rows[1].keys()
    assert differing == {"messages", "bytes", "sha256"}, "they are about the bag"
    assert rows[0]["ego_way_m"] == pytest.approx(10.0)


def test_statistics_count_the_boxes_of_the_first_agent(dataset: Path) -> None:
    alone, *others = statistics_of(open_dataset(dataset)).scenes
    assert [each.boxes for each in others] == [alone.boxes] * 2
    assert [each.distance_m for each in others] == pytest.approx([alone.distance_m] * 2)


def additional(spec: SceneSpec, tmp_path: Path) -> Scene:
    """The scene with an additional bag ``night``, recorded from another specification of it."""
    record_made_up(scene_folder(tmp_path, "train", SPEC.name), SPEC)
    record_made_up(tmp_path / f"scenes/train/{SPEC.name}.night", spec)
    return open_dataset(tmp_path).scenes[0]


def test_an_additional_bag_adds_keys_to_each_agent_that_it_has(tmp_path: Path) -> None:
    moved = [{**MAST_SENSORS[0], "pose": {"z_m": 9}}, {"type": "lidar", "name": "lidar_low", "pose": {"z_m": 1}}]
    scene = additional(with_agents(made_up_spec(SENSORS, number=2), roadside_unit(sensors=moved)), tmp_path)
    assert {"cam_front/rgb@night", "rsu/lidar_low/points", "boxes@night"} <= set(scene.keys)
    assert not {"odom@night", "rsu/odom@night"} & set(scene.keys), "the motion is the same"
    seen = scene.of_agent("rsu")
    assert {"cam/rgb", "cam/rgb@night", "lidar_low/points", "ego/boxes@night"} <= set(seen.keys)
    assert seen.calibration["cam@night"].ego_from_sensor[2, 3] == 9
    assert scene.of_agent("car").calibration.keys() == {sensor["name"] for sensor in SENSORS}


def test_the_only_agent_of_a_scene_may_have_another_name_in_an_additional_bag(tmp_path: Path) -> None:
    alone = made_up_spec(SENSORS, number=2)
    renamed = with_ego(alone, rig=alone.agents[0].rig.model_copy(update={"agent": "robot"}))
    record_made_up(scene_folder(tmp_path, "train", alone.name), alone)
    record_made_up(tmp_path / f"scenes/train/{alone.name}.night", renamed)
    scene = open_dataset(tmp_path).scenes[0]
    assert {"boxes", "boxes@night", "cam_front/rgb@night"} <= set(scene.keys)
    assert not any(key.startswith("robot/") for key in scene.keys)


def test_a_dataset_is_read_as_an_agent_of_some_scenes_sees_it(tmp_path: Path) -> None:
    record_made_up(tmp_path / "scenes/train/Blocks-0002", SPEC)
    record_made_up(tmp_path / "scenes/train/Blocks-0003", made_up_spec(MAST_SENSORS, number=3))
    dataset = open_dataset(tmp_path)
    assert dataset.agents == ("ego", "car", "rsu")
    assert [scene.name for scene in dataset.of_agent("ego").scenes] == ["Blocks-0002", "Blocks-0003"]
    (seen,) = dataset.of_agent("car").scenes
    assert (seen.agent, seen.chosen_agent) == ("car", "car")
    sent = pickle.loads(pickle.dumps(seen))
    assert sent.chosen_agent == "car" and sent.of_agent("ego").chosen_agent is None
    with pytest.raises(InputError, match="agent: no scene has 'bus', but car, ego, rsu"):
        dataset.of_agent("bus")
