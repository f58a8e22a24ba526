"""The launch files start the right programs, with the real ``launch`` where ROS is installed, else with a stand-in."""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commands import SCENE, Config
from ros_domain import DOMAIN
from rosgraph_msgs.msg import Clock
from subscriber import keep, outside_node
from waiting import PATIENCE_S

from simbev_ros.foundation.installation.ros_release import profile_variable
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.graph.exposure import LOCAL

REPOSITORY = Path(__file__).parents[3]
STAND_IN = REPOSITORY / "test" / "support" / "stand_in_of_launch"
FILES = ("simbev", "view", "play")
HAS_ROS = importlib.util.find_spec("launch") is not None and shutil.which("ros2") is not None

Launch = Callable[..., Any]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A prefix where the package is installed, as setup.py and colcon do it."""
    prefix = tmp_path / "prefix"
    (prefix / "share" / "ament_index" / "resource_index" / "packages").mkdir(parents=True)
    (prefix / "share" / "ament_index" / "resource_index" / "packages" / "simbev_ros").touch()
    (prefix / "share" / "simbev_ros").mkdir()
    for name in ("config", "launch"):
        (prefix / "share" / "simbev_ros" / name).symlink_to(REPOSITORY / name)
    others = os.environ.get("AMENT_PREFIX_PATH", "")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{prefix}{os.pathsep}{others}".rstrip(os.pathsep))
    for name in ("ROS_DOMAIN_ID", *LOCAL.variables):
        monkeypatch.delenv(name, raising=False)
    return prefix


@pytest.fixture
def launch(installed: Path, monkeypatch: pytest.MonkeyPatch) -> Launch:
    """Function that executes a launch file in the stand-in with some arguments; gives the context."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(STAND_IN))
    for name in [name for name in sys.modules if name.partition(".")[0] in ("launch", "launch_ros")]:
        monkeypatch.delitem(sys.modules, name)
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    from launch import LaunchContext

    for name in set(sys.modules) - before:
        monkeypatch.setitem(sys.modules, name, sys.modules[name])  # to be forgotten after the test

    def execute(name: str, **arguments: str) -> Any:
        context = LaunchContext(arguments)
        file = installed / "share" / "simbev_ros" / "launch" / f"{name}.launch.py"
        PythonLaunchDescriptionSource(str(file)).load().execute(context)
        return context

    return execute


def test_a_graph_is_started_with_the_arguments_and_the_variables_that_subscribers_need(launch: Launch) -> None:
    context = launch("simbev", config="my.yaml", record="out", namespace="sim1", domain="7", network="true")
    (graph,) = context.processes
    words = ["run", "my.yaml", "--live", "--network", "--record", "out", "--namespace", "sim1", "--ros-args"]
    assert graph.command == ["simbev_ros/simbev", *words]
    assert graph.environment["ROS_DOMAIN_ID"] == "7"
    assert graph.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"
    assert graph.environment.keys() >= LOCAL.variables.keys()
    assert Path(graph.environment[profile_variable()]).name == "fastdds_network.xml"
    assert Path(graph.environment[profile_variable()]).is_file()
    assert graph.on_exit.reason == "the graph has ended" and min(graph.patience_s) >= 20


def test_arguments_for_nodes_and_further_options_are_passed_on(launch: Launch) -> None:
    context = launch("simbev", live="false", simbev_args="--stack 'my stack'", ros_args="-r /a:=/b -p x:='a b'")
    (graph,) = context.processes
    words = ["run", "live", "--stack", "my stack", "--ros-args", "-r", "/a:=/b", "-p", "x:=a b", "--", "--ros-args"]
    assert graph.command[1:] == words


def test_variables_of_the_user_stay(launch: Launch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(profile_variable(), "/my/profile.xml")
    (graph,) = launch("simbev").processes
    assert graph.environment[profile_variable()] == "/my/profile.xml"
    assert graph.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert "ROS_DOMAIN_ID" not in graph.environment


def test_rviz_takes_simulated_time_and_below_a_namespace_every_topic_of_the_layout(launch: Launch) -> None:
    _, rviz = launch("simbev", view="true", namespace="/sim1/").processes
    assert rviz.command[:2] == ["rviz2/rviz2", "-d"] and Path(rviz.command[2]).name == "simbev.rviz"
    rules = set(rviz.command[rviz.command.index("--ros-args") :])
    assert "use_sim_time:=true" in rules
    text = Path(rviz.command[2]).read_text(encoding="utf-8")
    topics = {line.split(": ")[1] for line in text.splitlines() if ": /" in line}
    assert "/ego/lidar/points" in topics
    assert {f"{topic}:=/sim1{topic}" for topic in (*topics, "/tf", "/tf_static", "/clock")} <= rules
    (alone,) = launch("view").processes
    assert ":=/" not in " ".join(alone.command)


def test_a_bag_is_played_with_one_clock_and_the_chosen_qos(launch: Launch) -> None:
    (player,) = launch("play", bag="/data/bag", qos_overrides="qos.yaml", loop="true", start_offset="2.5").processes
    start = [
        "ros2",
        "bag",
        "play",
        "/data/bag",
        "--disable-keyboard-controls",
        "--rate",
        "1.0",
        "--start-offset",
        "2.5",
    ]
    more = ["--loop", "--qos-profile-overrides-path", "qos.yaml", "--clock", "100", "--exclude-topics", "/clock"]
    assert player.command == [*start, *more]
    assert player.on_exit.reason == "the bag has been played"
    (player,) = launch("play", bag="/data/bag", clock_hz="0").processes
    assert "--clock" not in player.command and "--start-offset" not in player.command
    assert len(launch("play", bag="/data/bag", view="true").processes) == 2


@pytest.mark.parametrize("name", FILES)
def test_every_argument_says_what_it_is_for(launch: Launch, name: str) -> None:
    declared = launch(name, bag="/data/bag").declared.values()
    assert declared and all(each.description for each in declared)


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("simbev", {"live": "yes"}, "Argument 'live' provided value 'yes' is not valid"),
        ("play", {}, "Required launch argument 'bag' was not provided"),
    ],
)
def test_bad_arguments_are_refused(launch: Launch, name: str, arguments: dict[str, str], message: str) -> None:
    with pytest.raises(RuntimeError, match=message):
        launch(name, **arguments)


@pytest.mark.graph
def test_the_launched_graph_runs_and_ends_cleanly_when_launch_is_interrupted(
    launch: Launch, small_config: Config, tmp_path: Path
) -> None:
    config = small_config(600, without=["camera", "lidar", "radar"])
    remapping = "-r /sim1/clock:=/time -p use_sim_time:=true"
    options = {
        "live": "false",
        "config": str(config),
        "domain": str(DOMAIN),
        "namespace": "sim1",
        "record": str(tmp_path / "out"),
    }
    (graph,) = launch("simbev", **options, ros_args=remapping).processes
    command = [sys.executable, "-m", "simbev_ros.cli.main", *graph.command[1:], "-p", "use_sim_time:=true"]
    process = subprocess.Popen(
        command, env=graph.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        with outside_node("outside") as (node, spin_until):
            clocks: list[Clock] = []
            node.create_subscription(Clock, "/time", keep(clocks), 10)
            spin_until(lambda: len(clocks) > 20)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
        process.wait()
    assert (process.returncode, output.rstrip()[-11:]) == (130, "interrupted"), output
    bag = tmp_path / "out" / f"{SCENE}.partial"
    assert (bag / "metadata.yaml").is_file()
    with SceneBag(bag) as opened:
        assert len(list(opened.messages(["/clock"]))) > 5, "the bag was closed in order"


@pytest.mark.skipif(not HAS_ROS, reason="no ROS is sourced")
@pytest.mark.parametrize("name", FILES)
def test_the_real_launch_reads_every_file(installed: Path, name: str) -> None:
    file = installed / "share" / "simbev_ros" / "launch" / f"{name}.launch.py"
    done = subprocess.run(["ros2", "launch", file, "--show-args"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "namespace" in done.stdout or "bag" in done.stdout
