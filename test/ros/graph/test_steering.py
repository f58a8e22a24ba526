"""A participant from outside holds the world, drives the ego, and stops and steps time in lockstep."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from commands import SCENE, Command, Simbev, leaving_nothing, write_small
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String
from subscriber import Caller, clock_ns, keep, outside_node, paused_ns

from simbev_ros.dataset.values import value_of
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import SignalState

pytestmark = pytest.mark.graph

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
STREET = "ego: {driver: twist}\ngraph: {participants: [driver], window_ticks: WINDOW}\n"
SPEED_MPS, YAW_RATE_RADPS = 6.0, 0.2


class Driver:
    """A listed participant, which reports ticks when it is asked to, or each one as it comes.

    Attributes:
        tick: The newest tick.
        keeps_up: Whether it reports each tick.
        speed_mps: Speed that it demands with each report; None: it sends no commands.
    """

    def __init__(self, command: Command, node: object, spin_until: Callable[..., None]) -> None:
        self.node, self.spin_until = node, spin_until
        self.tick, self.keeps_up = -100, False
        self.speed_mps: float | None = None
        scenes: list[String] = []
        node.create_subscription(String, "/world/scene", keep(scenes), LATCHED)
        self._ready = node.create_publisher(Header, "/sync/ready", LATCHED)
        self._wheel = node.create_publisher(Twist, "/ego/cmd_vel", 10)
        command.wait_for(lambda: scenes and self._wheel.get_subscription_count(), spin_until)
        self._spec = SceneSpec.model_validate_json(scenes[0].data)
        node.create_subscription(Clock, "/clock", self._on_clock, 50)

    def finish(self, tick: int) -> None:
        """Report a tick as finished."""
        self._ready.publish(header(self._spec.stamp_ns(tick), f"driver:{self._spec.name}"))

    def start(self) -> None:
        """Report the scene as loaded, and from now on each tick."""
        self.keeps_up = True
        self.finish(self._spec.loaded_tick if self.tick == -100 else self.tick)

    def _on_clock(self, message: Clock) -> None:
        self.tick = self._spec.tick_of(clock_ns(message))
        if self.speed_mps is not None:
            twist = Twist()
            twist.linear.x, twist.angular.z = self.speed_mps, YAW_RATE_RADPS * np.sin(0.1 * self.tick)
            self._wheel.publish(twist)
        if self.keeps_up:
            self.finish(self.tick)


@contextmanager
def driver_of(command: Command) -> Iterator[Driver]:
    with outside_node("driver") as (node, spin_until):
        yield Driver(command, node, spin_until)


def empty_street(folder: Path, duration_s: float, window_ticks: int) -> Path:
    """A configuration without other traffic, whose ego and time wait for the driver."""
    more = STREET.replace("WINDOW", str(window_ticks))
    config = write_small(folder, duration_s, more, without=["camera", "lidar", "radar"])
    config.write_text(config.read_text().replace("vehicles: 15, pedestrians: 15", "vehicles: 0, pedestrians: 0"))
    return config


@pytest.fixture(autouse=True)
def no_leftovers() -> None:
    """The graph of the module runs on after each test."""


@pytest.mark.slow
def test_equal_commands_lead_to_equal_bytes(simbev: Simbev, tmp_path: Path) -> None:
    config = empty_street(tmp_path, 4, window_ticks=1)
    digests = []
    for name in ("a", "b"):
        command = simbev("run", config, "--record", tmp_path / name)
        with driver_of(command) as driver:
            driver.speed_mps = SPEED_MPS
            driver.start()
            driver.spin_until(lambda command=command: command.process.poll() is not None)
        code, output = command.finish()
        assert code == 0, output
        with SceneBag(tmp_path / name / SCENE) as bag:
            assert bag.custom_data["complete"] == "true"
            digests.append(topic_digests(bag))
        del digests[-1]["/ego/boxes/markers"]  # the middleware leaves the padding between its fields uninitialized
    assert digests[0] == digests[1]


@pytest.mark.slow
def test_changed_conditions_are_recorded_and_replayed(simbev: Simbev, tmp_path: Path) -> None:
    services = pytest.importorskip("simbev_interfaces.srv")
    config = empty_street(tmp_path, 3, window_ticks=2)
    command = simbev("run", config, "--record", tmp_path / "changed")
    with driver_of(command) as driver:
        caller = Caller(driver.node, driver.spin_until)
        rain = services.SetWeather.Request(parameters="{precipitation: 80, wetness: 60}", transition=0.5, tick=10)
        assert caller.call(services.SetWeather, "/world/set_weather", rain).success
        green = services.HoldSignal.Request(id=1, state=3)
        assert caller.call(services.HoldSignal, "/world/hold_signal", green).success
        driver.start()
        driver.spin_until(lambda: command.process.poll() is not None)
    code, output = command.finish()
    assert code == 0, output
    replayed = write_small(tmp_path, 3, name="replay.yaml", without=["camera", "lidar", "radar"])
    code, output = simbev("replay", tmp_path / "changed" / SCENE, replayed, "--out", tmp_path / "replayed").finish()
    assert code == 0, output
    with SceneBag(tmp_path / "changed" / SCENE) as bag, SceneBag(tmp_path / "replayed" / SCENE) as again:
        (weather, same), (signals, _) = (
            [[value_of(m.type_name, [each.decode(m)]) for m in each.messages([name])] for each in (bag, again)]
            for name in ("/world/weather", "/world/signals")
        )
        assert topic_digests(bag)["/world/weather"] == topic_digests(again)["/world/weather"]
        assert topic_digests(bag)["/world/signals"] == topic_digests(again)["/world/signals"]
    assert weather == same
    assert [row["precipitation"] for row in weather][9::2][:7] == pytest.approx([0, 16, 32, 48, 64, 80, 80], abs=9)
    assert signals[-1]["state"][0] == SignalState.GREEN and np.isinf(signals[-1]["time_remaining"][0])


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driver]:
    """The driver in a graph that the tests below share; one above, with graphs of its own, must have ended."""
    config = empty_street(tmp_path_factory.mktemp("street"), 600, window_ticks=2)
    with leaving_nothing(), closing(Command("run", config)) as command, driver_of(command) as driver:
        yield driver


def test_world_is_at_most_the_window_ahead_of_a_listed_participant(driver: Driver) -> None:
    driver.keeps_up = False
    first = max(driver.tick, -1)
    driver.finish(first)
    driver.spin_until(lambda: driver.tick >= first + 2)  # another report would replace one that has not arrived
    driver.finish(first + 4)
    driver.spin_until(lambda: driver.tick >= first + 6)
    with pytest.raises(AssertionError, match="timed out"):
        driver.spin_until(lambda: driver.tick > first + 6, 1.5)
    driver.finish(first + 10)
    driver.spin_until(lambda: driver.tick == first + 12)


def test_services_control_the_world_in_lockstep(driver: Driver) -> None:
    driver.start()
    clocks: list[Clock] = []
    driver.node.create_subscription(Clock, "/clock", keep(clocks), 50)
    driver.spin_until(lambda: len(clocks) > 20)
    caller = Caller(driver.node, driver.spin_until)
    answer = caller.trigger("/world/step")
    assert (answer.success, answer.message) == (False, "pause first: /world/pause")
    answer = caller.pause(paused=True)
    assert (answer.success, answer.message) == (True, "paused")
    start_ns = paused_ns(clocks, driver.spin_until)
    for count in (1, 2):
        assert caller.trigger("/world/step").success
        driver.spin_until(lambda expected=start_ns + count * 50_000_000: clock_ns(clocks[-1]) == expected)
    assert paused_ns(clocks, driver.spin_until) == start_ns + 2 * 50_000_000
    answer = caller.trigger("/world/reset")
    refusal = "only a live scene can start again; in lockstep all nodes are in the middle of this one"
    assert (answer.success, answer.message) == (False, refusal)
    assert caller.pause(paused=False).message == "running"
    driver.spin_until(lambda: clock_ns(clocks[-1]) > start_ns + 10 * 50_000_000)


def test_the_ego_follows_commands(driver: Driver) -> None:
    odometry: list[Odometry] = []
    driver.node.create_subscription(Odometry, "/ego/odom", keep(odometry), 50)
    driver.start()
    driver.spin_until(lambda: odometry)
    assert odometry[0].twist.twist.linear.x < 0.1
    driver.speed_mps = SPEED_MPS
    driver.spin_until(lambda: len(odometry) > 80)
    assert odometry[-1].twist.twist.linear.x == pytest.approx(SPEED_MPS, abs=0.3)
    # At first, while the ego accelerates, its wheels lag behind.
    yaw_rates_radps = [each.twist.twist.angular.z for each in odometry[-30:]]
    assert max(map(abs, yaw_rates_radps)) == pytest.approx(YAW_RATE_RADPS, abs=0.05)
    driver.speed_mps = -SPEED_MPS
    driver.spin_until(lambda: odometry[-1].twist.twist.linear.x < -4.9)
    assert odometry[-1].twist.twist.linear.x > -5.1
