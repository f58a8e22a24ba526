"""simulation_interfaces in a running graph: worlds, states, steps, entities in every sensor and label, and the bag."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import SCENE, Command, Simbev, write_small
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient
from subscriber import Caller, outside_node

from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.conventions.simulation_interfaces import service_name

srv = pytest.importorskip("simulation_interfaces.srv")
msg = pytest.importorskip("simulation_interfaces.msg")
action = pytest.importorskip("simulation_interfaces.action")

pytestmark = [pytest.mark.graph, pytest.mark.slow]

STOPPED, PLAYING, PAUSED, QUITTING, NO_WORLD = 0, 1, 2, 3, 4
OK = msg.Result.RESULT_OK


class Client:
    """Calls the services of a graph that takes orders."""

    def __init__(self, node: Any, spin_until: Any) -> None:
        self.node, self.spin_until = node, spin_until
        self._caller = Caller(node, spin_until)

    def call(self, kind: str, **fields: Any) -> Any:
        """The answer of a service."""
        service = getattr(srv, kind)
        return self._caller.call(service, service_name(kind), service.Request(**fields))

    def ok(self, kind: str, **fields: Any) -> Any:
        """The answer of a service that must succeed."""
        answer = self.call(kind, **fields)
        assert answer.result.result == OK, f"{kind}: {answer.result.error_message}"
        return answer

    def refusal(self, kind: str, **fields: Any) -> tuple[int, str]:
        """Code and message of a service that must refuse."""
        result = self.call(kind, **fields).result
        assert result.result != OK, kind
        return result.result, result.error_message

    def state(self) -> int:
        """The state of the simulation."""
        return int(self.ok("GetSimulationState").state.state)

    def set_state(self, state: int) -> None:
        """Change the state of the simulation."""
        self.ok("SetSimulationState", state=msg.SimulationState(state=state))
        assert state == QUITTING or self.state() == state

    def load(self) -> None:
        """Load the small town, and pause before the first tick."""
        self.ok("LoadWorld", world_resource=msg.Resource(uri="Blocks"))
        assert self.state() == STOPPED
        self.set_state(PAUSED)

    def stamp_ns(self) -> int:
        """Stamp of the latest tick."""
        stamp = self.ok("GetEntityState", entity="ego").state.header.stamp
        return int(stamp.sec * 10**9 + stamp.nanosec)

    def step_action(self, steps: int) -> tuple[int, list[int]]:
        """Code of the result of SimulateSteps, and the completed steps of each feedback."""
        client, seen = ActionClient(self.node, action.SimulateSteps, service_name("SimulateSteps")), list[int]()
        self.spin_until(client.server_is_ready)
        goal = client.send_goal_async(
            action.SimulateSteps.Goal(steps=steps), lambda message: seen.append(message.feedback.completed_steps)
        )
        self.spin_until(goal.done)
        result = goal.result().get_result_async()
        self.spin_until(result.done)
        self.spin_until(lambda: len(seen) == steps or result.result().result.result.result != OK)
        client.destroy()
        return result.result().result.result.result, seen


@contextmanager
def client_of(command: Command) -> Iterator[Client]:
    with outside_node("client") as (node, spin_until):
        made = Client(node, spin_until)
        command.wait_for(lambda: "/load_world" in dict(node.get_service_names_and_types()), spin_until)
        yield made


def ahead_of_ego(x_m: float, y_m: float = 0.0) -> PoseStamped:
    pose = PoseStamped()
    pose.header.frame_id, pose.pose.position.x, pose.pose.position.y = "ego", x_m, y_m
    return pose


def test_the_simulation_is_steered_by_states_steps_resets_and_worlds(simbev: Simbev, tmp_path: Path) -> None:
    config = write_small(tmp_path, 600, without=["camera", "lidar", "radar"])
    command = simbev("run", config, "--serve")
    with client_of(command) as client:
        features = msg.SimulatorFeatures
        found = client.call("GetSimulatorFeatures").features.features
        assert features.SPAWNING in found and features.WORLD_RESOURCE_STRING not in found and len(found) == 30
        assert client.state() == NO_WORLD
        none = srv.GetCurrentWorld.Response.NO_WORLD_LOADED
        assert client.refusal("GetCurrentWorld") == (none, "no world is loaded")
        assert client.refusal("UnloadWorld") == (none, "no world is loaded")
        words = "the simulation is without a world"
        assert client.refusal("SetSimulationState", state=msg.SimulationState(state=PLAYING)) == (3, words)
        worlds = client.ok("GetAvailableWorlds", filter=msg.TagsFilter(tags=["town"])).worlds
        assert "Blocks" in [each.world_resource.uri for each in worlds]

        answers = srv.LoadWorld.Response
        for uri, code in (
            ("", answers.NO_RESOURCE),
            ("Nowhere", 2),
            ("world.sdf", answers.UNSUPPORTED_FORMAT),
            (str(tmp_path / "none.xodr"), answers.RESOURCE_PARSE_ERROR),
        ):
            assert client.refusal("LoadWorld", world_resource=msg.Resource(uri=uri))[0] == code
        client.ok("LoadWorld", world_resource=msg.Resource(uri="Blocks"))
        assert client.ok("GetCurrentWorld").world.world_resource.uri == "Blocks"
        assert client.state() == STOPPED
        assert client.refusal("StepSimulation", steps=1) == (4, "the simulation is stopped; pause it first")
        client.set_state(PAUSED)
        already = srv.SetSimulationState.Response.ALREADY_IN_TARGET_STATE
        paused = msg.SimulationState(state=PAUSED)
        assert client.refusal("SetSimulationState", state=paused) == (already, "the simulation is paused already")

        client.ok("StepSimulation", steps=1)
        first_ns = client.stamp_ns()
        client.ok("StepSimulation", steps=3)
        assert client.stamp_ns() - first_ns == 3 * 50_000_000
        assert client.step_action(5) == (OK, [1, 2, 3, 4, 5])
        assert client.stamp_ns() - first_ns == 8 * 50_000_000

        client.ok(
            "SpawnEntity", name="van", entity_resource=msg.Resource(uri="vehicle.van"), initial_pose=ahead_of_ego(9)
        )
        client.ok("ResetSimulation", scope=srv.ResetSimulation.Request.SCOPE_SPAWNED)
        assert client.refusal("GetEntityState", entity="van")[0] == msg.Result.RESULT_NOT_FOUND
        assert client.stamp_ns() - first_ns == 8 * 50_000_000
        words = "scope: spawned entities go with a new start; add 4 to it"
        assert client.refusal("ResetSimulation", scope=srv.ResetSimulation.Request.SCOPE_TIME) == (0, words)
        client.ok("ResetSimulation")
        assert client.state() == PAUSED and client.stamp_ns() < first_ns

        endless = client.node.create_client(srv.StepSimulation, "/step_simulation")
        steps = endless.call_async(srv.StepSimulation.Request(steps=10**15))
        client.set_state(PLAYING)
        client.spin_until(steps.done)
        assert (steps.result().result.result, steps.result().result.error_message) == (4, "pause first: /world/pause")
        assert client.step_action(1)[0] == msg.Result.RESULT_OPERATION_FAILED
        client.set_state(STOPPED)
        assert client.stamp_ns() < first_ns
        client.ok("UnloadWorld")
        assert client.state() == NO_WORLD
        client.set_state(QUITTING)
        command.wait_for(lambda: command.process.poll() is not None, client.spin_until)
    code, output = command.finish()
    assert (code, "Traceback" in output) == (0, False), output


def test_a_scene_that_steps_have_played_to_its_end_plays_again(simbev: Simbev, tmp_path: Path) -> None:
    command = simbev("run", write_small(tmp_path, 0.2, without=["camera", "lidar", "radar"]), "--serve")
    with client_of(command) as client:
        client.load()
        code, words = client.refusal("StepSimulation", steps=1000)
        assert (code, words) == (4, "the scene has ended") and client.state() == STOPPED
        client.ok("SetSimulationState", state=msg.SimulationState(state=PLAYING))
        ended = msg.Result.RESULT_INCORRECT_STATE
        command.wait_for(lambda: client.call("GetEntities").result.result == ended, client.spin_until)
        client.set_state(QUITTING)
        command.wait_for(lambda: command.process.poll() is not None, client.spin_until)


def play(command: Command) -> int:
    """Record a scene with a van in front of the ego, and without one of its pedestrians, whose id is returned."""
    with client_of(command) as client:
        client.load()
        client.ok("StepSimulation", steps=6)
        van = msg.Resource(uri="vehicle.van")
        spawned = client.ok("SpawnEntity", name="van", entity_resource=van, initial_pose=ahead_of_ego(12.0))
        people = client.ok("GetEntities", filters=msg.EntityFilters(filter="^pedestrian")).entities
        client.ok("DeleteEntity", entity=people[0])
        client.ok("StepSimulation", steps=4)
        state = client.ok("GetEntityState", entity=spawned.entity_name).state
        state.pose.position.z += 0.5
        state.twist.linear.x = 2.0
        client.ok("SetEntityState", entity="van", state=state, set_pose=True, set_twist=True)
        client.ok("SetSimulationState", state=msg.SimulationState(state=PLAYING))
        command.wait_for(lambda: client.state() == STOPPED, client.spin_until)
        again = srv.SetSimulationState.Response.STATE_TRANSITION_ERROR
        words = "a scene that is recorded cannot start again; load a world"
        assert client.refusal("SetSimulationState", state=msg.SimulationState(state=PLAYING)) == (again, words)
        client.set_state(QUITTING)
        command.wait_for(lambda: command.process.poll() is not None, client.spin_until)
    code, output = command.finish()
    assert code == 0, output
    return int(people[0].rpartition("_")[2])


def digests(dataset: Path) -> dict[str, str]:
    with SceneBag(dataset / SCENE) as bag:
        assert bag.custom_data["complete"] == "true"
        found = dict(topic_digests(bag))
    del found["/ego/boxes/markers"]  # the middleware leaves the padding between its fields uninitialized
    return found


def test_entities_are_in_every_sensor_label_and_bag_and_equal_calls_give_equal_bytes(
    simbev: Simbev, tmp_path: Path
) -> None:
    config = write_small(tmp_path, 1.5)
    for name in ("a", "b"):
        deleted = play(simbev("run", config, "--serve", "--record", tmp_path / name))
    assert digests(tmp_path / "a") == digests(tmp_path / "b")

    (scene,) = open_dataset(tmp_path / "a").scenes
    events = [each for each in scene.records("world/events") if each["type"].startswith("entity.")]
    assert [each["type"] for each in events] == ["entity.spawn", "entity.delete", "entity.set"]
    van = events[0]["ids"][0]
    assert events[1]["ids"] == [deleted] and events[2]["ids"] == [van]
    spawn, moved = events[0]["tick"], events[2]["tick"]
    assert moved - spawn == 4
    frames = {scene.spec.tick_of(frame.stamp_ns): frame for frame in scene}
    before, after = frames[spawn - 1], frames[spawn]
    assert van not in before["world/actors"]["id"] and deleted in before["world/actors"]["id"]
    assert van in after["world/actors"]["id"] and deleted not in after["world/actors"]["id"]
    seen = [each["boxes"][each["boxes"]["id"] == van] for tick, each in frames.items() if tick >= spawn]
    assert all(len(rows) == 1 for rows in seen)
    rows = np.concatenate(seen)
    assert rows["lidar_points"].max() > 5 and rows["radar_points"].max() > 0 and np.nanmax(rows["visibility"]) > 0.2
    truck = BEV_CLASSES.index("truck")
    cells = [int((frame["bev/labels"] >> truck & 1).sum()) for frame in (before, after)]
    assert cells[1] - cells[0] > 50
    track = np.concatenate([f["world/actors"][f["world/actors"]["id"] == van] for f in frames.values()])
    x_m, z_m = track["x"], track["z"]
    assert z_m[4] - z_m[3] == pytest.approx(0.5) and x_m[5] - x_m[4] == pytest.approx(0.1) and track["vx"][-1] == 2.0

    code, output = simbev("replay", tmp_path / "a" / SCENE, config, "--out", tmp_path / "replayed").finish()
    assert code == 0, output
    assert digests(tmp_path / "replayed") == digests(tmp_path / "a")


PAGE = (Path(__file__).parents[3] / "docs/guide/simulation-interfaces.md").read_text(encoding="utf-8")


def with_fields(message: Any, values: dict[str, Any]) -> Any:
    """A message with the fields of a mapping, as ``ros2`` fills it in."""
    for name, value in values.items():
        given = with_fields(getattr(message, name), value) if isinstance(value, dict) else value
        setattr(message, name, given)
    return message


def test_the_commands_of_the_page_work_as_printed(simbev: Simbev, tmp_path: Path) -> None:
    starts, calls = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    (script,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "client.py").write_text(script)
    config = write_small(tmp_path, 600, name="my.yaml", without=["camera", "lidar", "radar"])
    assert starts == "./simbev run my.yaml --serve\n"
    command = simbev("run", config, "--serve")
    with client_of(command) as client:
        for name, kind, text in re.findall(
            r'^ros2 service call (\S+) simulation_interfaces/srv/(\S+) "(.*)"$', calls, re.M
        ):
            assert name == service_name(kind)
            request = with_fields(getattr(srv, kind).Request(), yaml.safe_load(text))
            client.ok(kind, **{field: getattr(request, field) for field in request.get_fields_and_field_types()})
        goal = re.search(r'/simulate_steps simulation_interfaces/action/SimulateSteps "(.*)"$', calls, re.M)
        assert goal is not None
        assert client.step_action(**yaml.safe_load(goal[1])) == (OK, list(range(1, 21)))
        done = subprocess.run(
            [sys.executable, tmp_path / "client.py"],
            env=command.environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        names = ast.literal_eval(done.stdout)
        assert names[0] == "ego" and "van" in names
        client.set_state(QUITTING)
