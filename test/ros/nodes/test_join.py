"""A node with the helper joins a world: it loads scenes, reports ticks, and leaves, in any order of discovery."""

import ast
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped
from made_up_scene import made_up_spec
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header, String
from waiting import wait_until

from simbev_ros import join
from simbev_ros.join import Driver, Lockstep
from simbev_ros.ros.msgs.signing import Signer
from simbev_ros.ros.msgs.stamps import header, stamp_of, time_message
from simbev_ros.ros.nodes.lockstep import LockstepWindow
from simbev_ros.ros.nodes.reports import Report, read_report, subscribe_to_reports
from simbev_ros.schema.scene.spec import SceneSpec

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FIRST = made_up_spec([{"type": "gnss", "name": "gnss"}], ticks=20)
SECOND = FIRST.model_copy(update={"number": FIRST.number + 1})
NAME, DRIVER = "mine", "mine_driver"


class World:
    """Announces scenes and hears reports, as the world node does, in the same thread as the stack."""

    def __init__(self, context: Context, make_node: Callable[[str], Node]) -> None:
        self.context, self._make_node = context, make_node
        self.executor = SingleThreadedExecutor(context=context)
        self.stack = self._node("stack")
        self.node: Node | None = None
        self.reports: list[Report] = []
        self.lockstep = LockstepWindow([NAME], 3, outside=[NAME])

    def _node(self, name: str) -> Node:
        node = self._make_node(name)
        self.executor.add_node(node)
        return node

    def appear(self) -> None:
        self.node = self._node("world")
        subscribe_to_reports(self.node, self._on_ready, [NAME])
        self._scene = self.node.create_publisher(String, "/world/scene", LATCHED)

    def announce(self, spec: SceneSpec) -> None:
        self.lockstep.start_scene(spec)
        self._scene.publish(String(data=spec.model_dump_json()))

    def _on_ready(self, message: Header) -> None:
        report = read_report(message, Signer("key"), [NAME, DRIVER])
        self.reports.append(report)
        self.lockstep.record_report(report)

    def spin_until(self, condition: Callable[[], bool]) -> None:
        wait_until(condition, meanwhile=lambda: self.executor.spin_once(timeout_sec=0.05))

    def spin(self, duration_s: float) -> None:
        end_s = time.monotonic() + duration_s
        self.spin_until(lambda: time.monotonic() > end_s)

    def finish(self, lockstep: Lockstep, spec: SceneSpec, tick: int) -> None:
        lockstep.finished(time_message(spec.stamp_ns(tick)))


@pytest.fixture
def world(own_domain: Context, make_node: Callable[[str], Node]) -> Iterator[World]:
    made = World(own_domain, make_node)
    yield made
    made.executor.shutdown()


def test_each_scene_is_loaded_reported_and_followed_tick_by_tick(world: World) -> None:
    loaded: list[int] = []
    world.appear()
    with Lockstep(world.stack, NAME, load=lambda scene: loaded.append(scene["number"])) as lockstep:
        for spec in (FIRST, SECOND):
            world.announce(spec)
            world.spin_until(lambda: world.lockstep.all_loaded)
            assert loaded[-1] == spec.number and lockstep.scene == json.loads(spec.model_dump_json())
            assert world.lockstep.finished_by_all() == -1
            for tick in range(spec.ticks):
                world.finish(lockstep, spec, tick)
                world.spin_until(lambda tick=tick: world.lockstep.finished_by_all() == tick)
    assert loaded == [FIRST.number, SECOND.number]
    assert {report.scene for report in world.reports} == {FIRST.name, SECOND.name}


def test_a_node_that_joins_when_the_scene_has_been_announced_is_heard(world: World) -> None:
    world.appear()
    world.announce(FIRST)
    world.spin(0.3)
    with Lockstep(world.stack, NAME):
        world.spin_until(lambda: world.lockstep.all_loaded)


def test_a_world_that_appears_after_the_node_hears_it(world: World) -> None:
    with Lockstep(world.stack, NAME):
        world.spin(0.3)
        world.appear()
        world.announce(FIRST)
        world.spin_until(lambda: world.lockstep.all_loaded)


def test_loaded_is_repeated_until_the_first_input_is_finished(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(join, "_REPEAT_S", 0.2)
    world.appear()
    with Lockstep(world.stack, NAME) as lockstep:
        world.announce(FIRST)
        world.spin_until(lambda: len(world.reports) == 3)
        world.finish(lockstep, FIRST, 0)
        world.spin_until(lambda: world.lockstep.finished_by_all() == 0)
        count = len(world.reports)
        world.spin(0.7)
    assert len(world.reports) == count
    assert {report.stamp_ns for report in world.reports} == {0, FIRST.stamp_ns(0)}


def test_a_scene_is_not_loaded_before_the_inputs_are_connected(world: World) -> None:
    world.appear()
    world.stack.create_subscription(String, "/ego/text", lambda message: None, 10)
    with Lockstep(world.stack, NAME):
        world.announce(FIRST)
        world.spin(1.0)
        assert not world.reports
        assert world.node is not None
        world.node.create_publisher(String, "/ego/text", 10)
        world.spin_until(lambda: world.lockstep.all_loaded)


def test_an_input_that_nobody_publishes_is_waited_for_once(
    world: World, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(join, "_CONNECTION_PATIENCE_S", 0.5)
    world.appear()
    world.stack.create_subscription(String, "/nobody", lambda message: None, 10)
    with Lockstep(world.stack, NAME):
        for spec in (FIRST, SECOND):
            world.announce(spec)
            world.spin_until(lambda: world.lockstep.all_loaded)
    assert capfd.readouterr().err.count("nothing publishes /nobody; not waiting for it") == 1


def test_an_optional_input_is_not_waited_for(world: World, capfd: pytest.CaptureFixture[str]) -> None:
    world.appear()
    world.stack.create_subscription(String, "/nobody", lambda message: None, 10)
    with Lockstep(world.stack, NAME) as lockstep:
        lockstep.optional.add("/nobody")
        world.announce(FIRST)
        world.spin_until(lambda: world.lockstep.all_loaded)
    assert "nothing publishes" not in capfd.readouterr().err


def test_slow_inputs_are_reported_up_to_the_tick_before_the_next_one(world: World) -> None:
    world.appear()
    with Lockstep(world.stack, NAME, period_ticks=6) as lockstep:
        world.announce(FIRST)
        world.spin_until(lambda: world.lockstep.all_loaded)
        for tick, finished in ((0, 5), (6, 11), (12, 17), (18, 19)):  # the scene has 20 ticks
            assert world.lockstep.may_start(tick)
            world.finish(lockstep, FIRST, tick)
            world.spin_until(lambda finished=finished: world.lockstep.finished_by_all() == finished)


def test_an_input_of_the_scene_before_does_not_count(world: World) -> None:
    world.appear()
    with Lockstep(world.stack, NAME) as lockstep:
        world.finish(lockstep, FIRST, 3)  # no scene yet
        world.announce(SECOND)
        world.spin_until(lambda: lockstep.scene is not None)
        world.finish(lockstep, FIRST, 3)
        world.spin_until(lambda: world.lockstep.all_loaded)
    assert {report.stamp_ns for report in world.reports} == {0}


def test_leaving_delivers_the_last_report_and_leaves_no_entity_behind(world: World) -> None:
    world.appear()
    before = [list(getattr(world.stack, kind)) for kind in ("publishers", "subscriptions", "timers")]
    with Lockstep(world.stack, NAME) as lockstep:
        world.announce(FIRST)
        world.spin_until(lambda: world.lockstep.all_loaded)
        world.finish(lockstep, FIRST, 7)
    world.spin_until(lambda: world.lockstep.finished_by_all() == 7)
    assert [list(getattr(world.stack, kind)) for kind in ("publishers", "subscriptions", "timers")] == before


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "{}", '{"map": 3}', '{"map": {"name": "a"}, "number": "b"}', "[" * 9999]
)
def test_malformed_scenes_are_ignored(world: World, text: str) -> None:
    world.appear()
    with Lockstep(world.stack, NAME) as lockstep:
        world.announce(FIRST)
        world.spin_until(lambda: lockstep.scene is not None)
        before = lockstep.scene
        lockstep._on_scene(String(data=text))
        assert lockstep.scene is before


def test_leaving_works_after_ros_was_shut_down(world: World) -> None:
    with Lockstep(world.stack, NAME):
        world.context.shutdown()


def test_the_helper_imports_only_ros_and_the_standard_library() -> None:
    tree = ast.parse(Path(join.__file__).read_text(encoding="utf-8"))
    names = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    tops = {str(name).partition(".")[0] for name in names}
    standard = {"__future__", "collections", "functools", "json", "time", "typing"}
    assert tops == {*standard, "builtin_interfaces", "rclpy", "std_msgs"}


def test_a_driver_answers_whole_sets_of_inputs_with_a_command_for_each_tick(world: World) -> None:
    decided: list[set[str]] = []
    commands: list[PoseStamped] = []

    def decide(inputs: dict[str, PoseStamped], scene: dict[str, object]) -> PoseStamped:
        decided.append({*inputs})
        assert scene["number"] == FIRST.number
        return PoseStamped()

    world.appear()
    inputs = {"/ego/a": PoseStamped, "/ego/b": PoseStamped}
    driver = Driver(world.stack, decide, inputs, ("/mine/command", PoseStamped), period_ticks=2)
    world.lockstep = LockstepWindow([DRIVER], 3, outside=[DRIVER])
    assert world.node is not None
    a, b = (world.node.create_publisher(PoseStamped, name, 10) for name in inputs)
    world.announce(FIRST)
    world.spin(1.0)
    assert not world.reports  # nobody hears its commands
    world.node.create_subscription(PoseStamped, "/mine/command", commands.append, 10)
    world.spin_until(lambda: world.lockstep.all_loaded)
    a.publish(PoseStamped(header=header(FIRST.stamp_ns(0), "")))
    world.spin(0.3)
    assert decided == []
    b.publish(PoseStamped(header=header(FIRST.stamp_ns(0), "")))
    world.spin_until(lambda: len(commands) == 2 and world.lockstep.finished_by_all() == 1)
    assert [stamp_of(each.header.stamp) for each in commands] == [FIRST.stamp_ns(tick) for tick in (0, 1)]
    assert decided == [{"/ego/a", "/ego/b"}]
    driver.lockstep.close()


def test_a_driver_holds_inputs_that_come_less_often_and_waits_for_them_when_they_are_due(world: World) -> None:
    decided: list[list[int]] = []
    loaded: list[object] = []

    def decide(inputs: dict[str, PoseStamped], scene: dict[str, object]) -> PoseStamped:
        decided.append(
            [round((stamp_of(inputs[name].header.stamp) - FIRST.start_ns) / FIRST.tick_ns) for name in names]
        )
        return PoseStamped()

    world.appear()
    names = ["/ego/often", "/ego/seldom"]
    driver = Driver(
        world.stack,
        decide,
        dict.fromkeys(names, PoseStamped),
        ("/mine/command", PoseStamped),
        load=loaded.append,
        periods={"/ego/seldom": 3},
    )
    world.lockstep = LockstepWindow([DRIVER], 8, outside=[DRIVER])
    assert world.node is not None
    often, seldom = (world.node.create_publisher(PoseStamped, name, 10) for name in names)
    world.node.create_subscription(PoseStamped, "/mine/command", lambda _: None, 10)
    world.announce(FIRST)
    world.spin_until(lambda: world.lockstep.all_loaded)
    assert len(loaded) == 1
    for tick in range(-1, 5):
        often.publish(PoseStamped(header=header(FIRST.stamp_ns(tick), "")))
    seldom.publish(PoseStamped(header=header(FIRST.stamp_ns(0), "")))
    world.spin_until(lambda: world.lockstep.finished_by_all() == 2)
    assert decided == [[0, 0], [1, 0], [2, 0]]
    seldom.publish(PoseStamped(header=header(FIRST.stamp_ns(3), "")))
    world.spin_until(lambda: world.lockstep.finished_by_all() == 4)
    assert decided[3:] == [[3, 3], [4, 3]]
    driver.lockstep.close()
