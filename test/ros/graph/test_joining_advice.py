"""The supervisor says what a participant from outside has to change before it is heard."""

from collections.abc import Callable, Iterator

import pytest
from made_up_scene import made_up_spec
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_domain import DOMAIN
from std_msgs.msg import Header, String
from subscriber import outside_node
from waiting import wait_until

from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import GraphError
from simbev_ros.ros.graph import monitor as monitor_module
from simbev_ros.ros.graph.joining_advice import JoiningAdvice, OutsidePublisher
from simbev_ros.ros.graph.monitor import GraphMonitor
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.ros.msgs.signing import Signer
from simbev_ros.ros.nodes.reports import Report
from simbev_ros.scene.request import SceneRequest

SPEC = made_up_spec([{"type": "gnss", "name": "gnss"}])
DEFAULT = OutsidePublisher("my_node", "std_msgs/msg/Header", is_reliable=True, is_latched=False)
BEST_EFFORT_REMEDY = (
    "my_node publishes best effort on /sync/ready, which is not heard: make the publisher reliable,"
    ' as create_publisher(Header, "/sync/ready", 10) does'
)


@pytest.fixture
def joining() -> JoiningAdvice:
    made = JoiningAdvice(["mine"], 7)
    made.start_scene(SPEC)
    return made


def test_a_participant_that_is_not_there_has_to_be_started_in_the_domain(joining: JoiningAdvice) -> None:
    assert joining.advice({"mine": None}, []) == [
        "no node outside the graph publishes on /sync/ready: start mine with ROS_DOMAIN_ID=7 and the profile that "
        "simbev run shows for subscribers"
    ]


def test_a_best_effort_publisher_has_to_become_reliable(joining: JoiningAdvice) -> None:
    assert joining.advice({"mine": None}, [DEFAULT._replace(is_reliable=False)]) == [BEST_EFFORT_REMEDY]


def test_the_topic_is_named_with_the_namespace_of_the_graph() -> None:
    joining = JoiningAdvice(["mine"], 7, "/sim1/sync/ready")
    joining.start_scene(SPEC)
    for publishers in (
        [],
        [DEFAULT],
        [DEFAULT._replace(is_reliable=False)],
        [DEFAULT._replace(type="std_msgs/msg/Bool")],
    ):
        (said,) = joining.advice({"mine": None}, publishers)
        assert " on /sim1/sync/ready" in said


def test_a_publisher_of_another_type_has_to_publish_headers(joining: JoiningAdvice) -> None:
    assert joining.advice({"mine": None}, [DEFAULT._replace(type="std_msgs/msg/String")]) == [
        "my_node publishes std_msgs/msg/String on /sync/ready; it must be std_msgs/msg/Header"
    ]


def test_only_a_publisher_that_is_not_latched_has_to_repeat_its_first_report(joining: JoiningAdvice) -> None:
    words = (
        "my_node publishes on /sync/ready, but no report of mine has arrived: publish a std_msgs/Header with frame_id "
        f"mine:{SPEC.name} when the scene is loaded"
    )
    assert joining.advice({"mine": None}, [DEFAULT._replace(is_latched=True)]) == [words]
    (said,) = joining.advice({"mine": None}, [DEFAULT])
    assert said.startswith(f"{words}, and repeat it until inputs arrive, or latch the publisher")


@pytest.mark.parametrize("frame_id", ["yours:Blocks-0000", "", "my_stack"])
def test_a_wrong_name_is_shown_beside_the_right_one(joining: JoiningAdvice, frame_id: str) -> None:
    joining.note_unknown(frame_id)
    joining.note_unknown("lidar:Blocks-0000:signature of another graph")
    said = [f"a report has the frame_id {frame_id!r} instead of mine:{SPEC.name}"]
    assert joining.advice({"mine": None}, [DEFAULT]) == said


def test_a_scene_that_does_not_exist_is_a_wrong_name_but_an_earlier_scene_is_not(joining: JoiningAdvice) -> None:
    joining.note_report(Report("mine", "Blocks-0009", 0), "mine:Blocks-0009")
    (said,) = joining.advice({"mine": None}, [DEFAULT])
    assert said == f"a report has the frame_id 'mine:Blocks-0009' instead of mine:{SPEC.name}"
    following = SPEC.model_copy(update={"number": SPEC.number + 1})
    joining.start_scene(following)
    joining.note_report(Report("mine", SPEC.name, 0), f"mine:{SPEC.name}")
    (said,) = joining.advice({"mine": None}, [DEFAULT])
    assert said.startswith("my_node publishes on /sync/ready, but no report of mine has arrived")


def test_stamps_of_the_wall_clock_are_shown_beside_those_of_the_scene(joining: JoiningAdvice) -> None:
    joining.note_report(Report("mine", SPEC.name, 1_795_600_000_250_000_000), f"mine:{SPEC.name}")
    first_s, last_s = (SPEC.stamp_ns(tick) / 1e9 for tick in (0, SPEC.ticks - 1))
    assert joining.advice({"mine": -1}, [DEFAULT]) == [
        "mine has loaded the scene but not finished a tick; its last report has the stamp 1795600000.25 s, and those "
        f"of the scene's ticks are {first_s:.2f} s to {last_s:.2f} s: report the header.stamp of each input when it is "
        "finished"
    ]


def test_there_is_no_advice_for_slow_participants_and_nodes_of_the_graph(joining: JoiningAdvice) -> None:
    assert joining.advice({"mine": 3, "lidar": None}, []) == []


@pytest.fixture
def monitor(monkeypatch: pytest.MonkeyPatch) -> Iterator[GraphMonitor]:
    """A monitor that waits for ``mine``, and runs out of patience soon."""
    monkeypatch.setattr(monitor_module, "_PATIENCE_S", 0.5)
    monkeypatch.setattr(monitor_module, "_ADVICE_PERIOD_S", 0.1)
    made = GraphMonitor(DOMAIN, (), ["mine"], Signer("key"))
    made.request(SceneRequest(spec=SPEC))
    yield made
    made.close()


def advice_of(monitor: GraphMonitor, until: Callable[[], bool] = lambda: False) -> list[str]:
    """The first advice that the monitor has."""
    advice: list[str] = []
    wait_until(lambda: advice.extend(monitor.new_advice()) or advice or until(), meanwhile=lambda: monitor.spin(0.05))
    return advice


@pytest.mark.parametrize(
    ("kind", "qos", "remedy"),
    [
        (Header, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT), BEST_EFFORT_REMEDY),
        (String, QoSProfile(depth=1), "my_node publishes std_msgs/msg/String on /sync/ready; it must be"),
        (Header, QoSProfile(depth=1), "latch the publisher (transient local): others lose"),
        (
            Header,
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
            f"publish a std_msgs/Header with frame_id mine:{SPEC.name} when the scene is loaded",
        ),
    ],
    ids=["best effort", "another type", "default", "latched"],
)
def test_publishers_are_found_in_the_ros_graph_and_advice_is_given_once(
    monitor: GraphMonitor, kind: type, qos: QoSProfile, remedy: str
) -> None:
    with outside_node("my_node") as (node, spin_until):
        publisher = node.create_publisher(kind, "/sync/ready", qos)
        spin_until(lambda: len(monitor._outside_publishers()) == 1)
        (said,) = advice_of(monitor)
        assert remedy in said
        monitor.spin(0.3)
        assert monitor.new_advice() == []
        node.destroy_publisher(publisher)


def test_the_error_at_the_end_repeats_the_advice(monitor: GraphMonitor) -> None:
    session = GraphSession(load_scenario("paper"), domain=DOMAIN)
    session._monitor = monitor
    monitor._progress_s -= 1000
    try:
        with pytest.raises(GraphError) as error:
            session._check(None)
    finally:
        session._failed, session._monitor = False, None
        session.close()
    assert str(error.value).startswith(
        "node mine has been silent for 60 s, while the scene was loading; "
        f"no node outside the graph publishes on /sync/ready: start mine with ROS_DOMAIN_ID={DOMAIN}"
    )


def test_a_report_that_arrives_ends_the_advice(monitor: GraphMonitor) -> None:
    def is_loaded() -> bool:
        return monitor.behind_world.all_loaded

    with outside_node("my_node") as (node, spin_until):
        ready = node.create_publisher(Header, "/sync/ready", 10)
        spin_until(lambda: ready.get_subscription_count() == 1)
        ready.publish(Header(frame_id=f"mine:{SPEC.name}"))
        advice_of(monitor, until=is_loaded)
        assert is_loaded()
