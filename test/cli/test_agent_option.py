"""``--agent`` shows what one agent of a scene has recorded; a wrong name is refused with those that there are."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from made_up_scene import MadeUp, boxes, made_up_scene, record_made_up
from ros_messages import string
from several_agents import made_up_agents

from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.show.sheet.frames import FrameReader
from simbev_ros.show.sheet.views import find_views

Run = Callable[..., Any]
SPEC = made_up_agents()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MadeUp]:
    """A bag with the agents ego, car and rsu, and boxes of all of them together."""
    path = tmp_path_factory.mktemp("agents") / SPEC.name
    return path, record_made_up(path, SPEC, tables={"/world/boxes": boxes(np.random.default_rng(7), 5)})


@pytest.fixture(scope="module")
def bag(made: tuple[Path, MadeUp]) -> Path:
    return made[0]


@pytest.mark.parametrize("words", [["info"], ["preview", "--no-video"], ["view", "--out", "a.rrd"]])
def test_an_unknown_agent_is_named_with_those_that_there_are(refused: Run, bag: Path, words: list[str]) -> None:
    if words[0] == "view":
        pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
    message = refused(words[0], bag, *words[1:], "--agent", "bus")
    more = ", all" if words[0] == "preview" else ""
    assert message == f"error: --agent 'bus': Blocks-0002 has ego, car, rsu{more}\n"


def test_the_agents_of_a_bag_without_a_scene_are_not_known(refused: Run, tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/ego/words", "std_msgs/msg/String", QosProfile())
        writer.write("/ego/words", 0, string("a word"))
        path = writer.finish({})
    message = "error: --agent 'ego': bag has no scene, so its agents are not known\n"
    assert refused("info", path, "--agent", "ego") == message
    assert "bag_0.mcap: it holds no scene: scene.json is not attached" in refused("preview", path, "--agent", "ego")


def test_what_does_not_go_together_is_refused(refused: Run, bag: Path, tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    for words in ([bag, "--report", tmp_path / "report"], [tmp_path]):
        message = "error: --agent 'car': is for a scene's bag, without --report\n"
        assert refused("info", *words, "--agent", "car") == message


def test_info_describes_every_agent(simbev: Run, bag: Path) -> None:
    scene = json.loads(simbev("info", bag, "--json").out)["scene"]
    assert list(scene["agents"]) == ["ego", "car", "rsu"]
    assert scene["agents"]["ego"] == {"carrier": "vehicle.sedan", "rig": scene["rig"]}
    assert scene["agents"]["rsu"]["carrier"] == "roadside unit" and len(scene["agents"]["rsu"]["rig"]) == 2
    text = simbev("info", bag).out
    assert re.search(r"rig of rsu +roadside unit *\n +1 camera 32x24", text)


def test_info_of_an_agent_has_its_rig_and_its_topics_alone(simbev: Run, bag: Path) -> None:
    everything = json.loads(simbev("info", bag, "--json", "--digest").out)
    facts = json.loads(simbev("info", bag, "--json", "--digest", "--agent", "rsu").out)
    assert facts["scene"]["rig"] == everything["scene"]["agents"]["rsu"]["rig"]
    assert list(facts["scene"]["agents"]) == ["rsu"]
    assert facts["topics"] == [topic for topic in everything["topics"] if topic["name"].startswith("/rsu/")]
    assert facts["topics"] and facts["digest"] == everything["digest"]


def test_info_of_a_scene_with_one_agent_has_its_rig_as_one_row(simbev: Run, tmp_path: Path) -> None:
    made_up_scene(tmp_path / "Blocks-0000")
    assert re.search(r"^rig +2 cameras 32x24", simbev("info", tmp_path / "Blocks-0000").out, re.MULTILINE)


@pytest.mark.parametrize("agent", [None, "ego", "car", "rsu"])
def test_a_preview_shows_what_its_agent_sees(made: tuple[Path, MadeUp], agent: str | None) -> None:
    name = agent or "ego"
    scene = open_dataset(made[0]).scenes[0].of_agent(name)
    views = find_views(scene, "cameras")
    assert list(views.cameras) == (["cam"] if name == "rsu" else ["cam_front", "cam_back_left"])
    (frame,) = FrameReader(scene, views).frames(1, 1)
    ticks = made[1].ticks if name == "ego" else made[1].others[name]
    assert frame.arrays["bev/labels"].tobytes() == ticks[1]["bev/labels"].tobytes()


def test_previews_of_agents_lie_side_by_side(simbev: Run, bag: Path, tmp_path: Path) -> None:
    for words in ([], ["--agent", "car"], ["--agent", "rsu"]):
        assert simbev("preview", bag, "--out", tmp_path, "--no-video", *words).code == 0
    pictures = {file.name: np.asarray(cv2.imread(str(file)), np.uint8) for file in tmp_path.iterdir()}
    assert sorted(pictures) == [f"{SPEC.name}.car.png", f"{SPEC.name}.png", f"{SPEC.name}.rsu.png"]
    first, other = pictures[f"{SPEC.name}.png"], pictures[f"{SPEC.name}.car.png"]
    assert differ(first, other), "they have other labels"


def differ(a: UInt8Array, b: UInt8Array) -> bool:
    """Whether more than the captions of two pictures differ."""
    return a.shape != b.shape or bool((a != b).mean() > 0.02)


def test_view_shows_the_chosen_agent(simbev: Run, made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
    from rerun.chunk import RrdReader
    from rerun_file import rows_by_entity

    ids = {}
    for agent in ("ego", "car", "rsu"):
        out = tmp_path / f"{agent}.rrd"
        assert simbev("view", made[0], "--out", out, "--agent", agent).code == 0
        rows, (recording,) = rows_by_entity(out), RrdReader(out).recordings()
        ids[agent] = recording.recording_id
        moving = [row.values["Transform3D:translation"] for row in rows["world/ego"] if row.tick is not None]
        expected = [values["odom"][0] for values in (made[1].ticks if agent == "ego" else made[1].others[agent])]
        np.testing.assert_allclose(np.reshape(moving, (-1, 3)), expected, atol=1e-5)
        assert ("world/ego/body" in rows) == (agent != "rsu"), "a mast has no body"
        assert ("world/ego/cam_front" in rows) == (agent != "rsu")
    assert ids["ego"] == "Blocks-0002-2" and len(set(ids.values())) == 3, "files may be opened together"
