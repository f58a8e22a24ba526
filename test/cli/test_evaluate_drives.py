"""``simbev evaluate`` with a dataset alone: drives as recorded or judged again, as tables, JSON and a page."""

import json
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_cases import EGO_ID, RIGHT_M, TICK_S, actor, network, spec, state, straight
from ros_messages import odometry, point_cloud, string

from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.statistics import statistics_of
from simbev_ros.evaluation.driving import recorded_drives
from simbev_ros.evaluation.driving.figures import drive_figures
from simbev_ros.evaluation.driving.recorded_drives import drives_of
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.evaluation.driving.static_world import SolidMesh
from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.ros.msgs.world import event_record
from simbev_ros.scene.legend import legend
from simbev_ros.schema.scene.state import Event

Answer = Any
TICKS = 120
TYPES = {
    "/ego/odom": "nav_msgs/msg/Odometry",
    "/world/actors": "sensor_msgs/msg/PointCloud2",
    "/world/signals": "sensor_msgs/msg/PointCloud2",
    "/world/events": "std_msgs/msg/String",
    "/drive/events": "std_msgs/msg/String",
    "/drive/score": "std_msgs/msg/String",
}
WORLD_EVENTS = {3: ["merge.begin"], 7: ["merge.end", "fog_bank.begin"], 50: ["collision"], 60: ["merge.begin"]}
SCENE = spec().model_copy(update={"ticks": TICKS})
EGO, CAR = straight(10.0), straight(0.0, 50.0)


@pytest.fixture(autouse=True)
def _street() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorded_drives, "load_network", lambda _: network())
        patch.setattr(recorded_drives, "load_static_world", lambda *_: SolidMesh(np.zeros((0, 3, 3))))
        yield


def record(folder: Path, *, has_referee: bool = True, events: str = "", has_drive: bool = True) -> dict[str, Any]:
    """Write a bag in which the ego drives into a standing car; returns the figures of its drive."""
    scene = SCENE if has_drive else SCENE.model_copy(update={"drive": None})
    referee = Referee(SCENE, network())
    with SceneBagWriter(folder) as writer:
        writer.add_attachment("scene.json", "application/json", scene.model_dump_json().encode())
        for topic, type_name in TYPES.items():
            writer.add_topic(topic, type_name, QosProfile())
        writer.add_topic("/world/legend", "std_msgs/msg/String", QosProfile(durability="transient_local"))
        writer.write("/world/legend", scene.start_ns, string(json.dumps(legend(()))))
        for tick in range(TICKS):
            stamp_ns, time_s = scene.stamp_ns(tick), tick * TICK_S
            seen = state(scene, tick, [actor(EGO_ID, EGO, time_s), actor(2, CAR, time_s)])
            begun = referee.judge(seen)
            place_m = np.array([10.0 + 10.0 * time_s, RIGHT_M, 0.0])
            writer.write("/ego/odom", stamp_ns, odometry(stamp_ns, place_m, np.zeros(3)))
            writer.write("/world/actors", stamp_ns, point_cloud(stamp_ns, seen.actors))
            writer.write("/world/signals", stamp_ns, point_cloud(stamp_ns, seen.signals))
            for kind in WORLD_EVENTS.get(tick, ()):
                event = Event(kind, (2,), (*place_m,), 0.0)
                writer.write("/world/events", stamp_ns, string(json.dumps(event_record(event, seen))))
            for infraction in begun if has_referee else ():
                writer.write("/drive/events", stamp_ns, string(events or json.dumps(infraction.record())))
            if has_referee and (tick % 10 == 9 or begun):
                writer.write("/drive/score", stamp_ns, string(json.dumps(drive_figures(referee.record))))
        writer.finish({"scene": scene.name})
    return drive_figures(referee.record)


def test_a_drive_is_the_same_as_recorded_and_judged_again(tmp_path: Path) -> None:
    figures = record(tmp_path / "a")
    record(tmp_path / "b", has_referee=False)
    found = [
        drives_of(open_dataset(tmp_path / name).scenes, again=again)[0]
        for name, again in (("a", False), ("a", True), ("b", False))
    ]
    for drive in found:
        assert json.loads(json.dumps(drive.figures)) == json.loads(json.dumps(figures))
        assert [each.kind.value for each in drive.infractions] == ["time_to_collision", "collision_vehicle"]
        assert drive.infractions == found[0].infractions


def test_scores_are_printed_and_written_and_each_infraction_has_pictures(
    simbev: Callable[..., Answer], tmp_path: Path
) -> None:
    record(tmp_path / "bag")
    answer = simbev("evaluate", tmp_path / "bag", "--report", tmp_path / "r.html", "--json", tmp_path / "f.json")
    assert answer.code == 0, answer.err
    row = re.split(r"\s{2,}", next(line for line in answer.out.splitlines() if "Blocks-0000" in line).strip())
    completed = 100.0 * (10.0 * (TICKS - 1) * TICK_S) / 300.0
    assert [float(each) for each in row[1:4]] == pytest.approx([completed, completed * 0.6, completed / 1.7], abs=6e-4)
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["scores"]["leaderboard_2_1"]["driving_score"] == pytest.approx(completed / 1.7)
    events = figures["scenes"]["Blocks-0000"]["events"]
    assert [event["kind"] for event in events] == ["time_to_collision", "collision_vehicle"]
    told = [each["type"] for each in figures["scenes"]["Blocks-0000"]["route_events"]]
    assert told == ["merge.begin", "merge.end", "fog_bank.begin", "merge.begin"]
    counts = [re.split(r"\s{2,}", line.strip()) for line in answer.out.splitlines() if "merge" in line or "fog" in line]
    assert counts == [["merge", "2", "1"], ["fog_bank", "1", "0"]]
    page = (tmp_path / "r.html").read_text()
    assert page.count("<svg viewBox") == 8
    _, first, second = re.split("<p><b>", page)
    assert first.startswith("time to collision, 0.9 s")
    assert second.startswith("collision vehicle, 10 m/s")
    for strip in (first, second):
        assert re.findall("<figcaption>([^<]+)<", strip) == ["2 s before", "1 s before", "now", "1 s after"]
    assert second.count('class="missed"') == 4 and "actor 2" in second


@pytest.mark.parametrize(
    ("options", "words"),
    [({"has_drive": False}, "no scene has a route to drive"), ({"events": '{"kind": "bad"}'}, "/drive: no infraction")],
)
def test_what_cannot_be_scored_is_refused(
    simbev: Callable[..., Answer], tmp_path: Path, options: dict[str, Any], words: str
) -> None:
    record(tmp_path / "bag", **options)
    answer = simbev("evaluate", tmp_path / "bag")
    assert answer.code != 0
    assert words in answer.err
    assert "Traceback" not in answer.err


def test_the_drive_of_a_scene_that_failed_has_a_score(simbev: Callable[..., Answer], tmp_path: Path) -> None:
    record(tmp_path / "scenes" / "train" / "Blocks-0000.partial")
    (tmp_path / "scenes" / "train" / "Blocks-0001.partial").mkdir()
    answer = simbev("evaluate", tmp_path)
    assert answer.code == 0, answer.err
    assert "as their scenes failed: Blocks-0000" in answer.out
    assert "collision_vehicle" in answer.out or "collision vehicle" in answer.out


def test_only_collisions_count_as_such_in_statistics(tmp_path: Path) -> None:
    record(tmp_path / "bag")
    assert [each.collisions for each in statistics_of(open_dataset(tmp_path / "bag")).scenes] == [1]


@pytest.mark.parametrize("changes", [{"scores": {}}, {"infractions": {"collision": "many"}}, {"driven_m": math.inf}])
def test_a_malformed_score_is_refused(tmp_path: Path, changes: dict[str, object]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "test_evaluate_drives.drive_figures", lambda drive, real=drive_figures: {**real(drive), **changes}
        )
        record(tmp_path / "bag")
    with pytest.raises(BagError, match=r"/drive: (no score of a drive|Out of range)"):
        drives_of(open_dataset(tmp_path / "bag").scenes)
