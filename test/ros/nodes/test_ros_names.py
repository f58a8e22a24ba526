"""Names of a graph become names in ROS below its namespace, and back; ROS's arguments are split off a command's."""

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.arguments import RosArguments, split_ros_arguments
from simbev_ros.ros.conventions.names import NodeName, graph_name, ros_name


@pytest.mark.parametrize(
    ("name", "namespace", "expected"),
    [
        ("/ego/lidar/points", "", "/ego/lidar/points"),
        ("/ego/lidar/points", "/sim1", "/sim1/ego/lidar/points"),
        ("/tf", "/fleet/sim1", "/fleet/sim1/tf"),
        ("/diagnostics", "/sim1", "/diagnostics"),
        ("/rosout", "/sim1", "/rosout"),
        ("/parameter_events", "/sim1", "/parameter_events"),
        ("lidar/get_parameters", "/sim1", "lidar/get_parameters"),
    ],
)
def test_absolute_names_are_below_the_namespace_unless_all_graphs_share_them(
    name: str, namespace: str, expected: str
) -> None:
    assert ros_name(name, namespace) == expected
    assert not name.startswith("/") or graph_name(expected, namespace) == name


@pytest.mark.parametrize("name", ["/clock", "/sim10/clock", "/sim1"])
def test_a_name_beside_the_namespace_is_none_of_the_graph(name: str) -> None:
    assert graph_name(name, "/sim1") is None


def test_nodes_of_an_agent_are_in_its_namespace() -> None:
    lidar = NodeName.parse("ego/lidar", "/sim1")
    assert lidar == NodeName("lidar", "ego", "/sim1")
    assert (lidar.namespace, lidar.full, lidar.path) == ("/sim1/ego", "/sim1/ego/lidar", "ego/lidar")
    world = NodeName("world")
    assert (world.namespace, world.full, world.path) == ("/", "/world", "world")
    assert NodeName("world", graph="/sim1").full == "/sim1/world"


def test_words_between_ros_args_and_two_dashes_are_for_ros() -> None:
    words = ["live", "--ros-args", "-r", "/a:=/b", "--", "--live", "--ros-args", "-p", "x:=1"]
    assert split_ros_arguments(words) == (["live", "--live"], ["-r", "/a:=/b", "-p", "x:=1"])
    assert split_ros_arguments(["live", "--ros-args"]) == (["live"], [])
    assert split_ros_arguments(["--", "live"]) == (["--", "live"], [])


def test_the_rule_for_the_namespace_is_the_option_and_the_rest_stays() -> None:
    words = ["-r", "/a:=/b", "--remap", "__ns:=/sim1", "-p", "use_sim_time:=false"]
    ros = RosArguments.parse(words)
    assert ros == RosArguments("/sim1", ("-r", "/a:=/b", "-p", "use_sim_time:=false"))
    assert ros == RosArguments.parse(words, "sim1/")
    assert ros.for_nodes == ["--ros-args", "-r", "/a:=/b", "-p", "use_sim_time:=false"]
    assert ros.command("-p", "x:=1") == [
        "--ros-args", "-p", "x:=1", "-r", "/a:=/b", "-p", "use_sim_time:=false", "-r", "__ns:=/sim1"
    ]  # fmt: skip
    assert RosArguments.parse(["-r", "__ns:=/"]) == RosArguments()
    assert RosArguments.parse(["-r", "lidar:__node:=roof"]).words == ("-r", "lidar:__node:=roof")


@pytest.mark.parametrize(
    ("words", "namespace", "message"),
    [
        ([], "1sim", "^namespace: '1sim' is not a namespace; allowed: letters, digits and _ in parts"),
        ([], "a//b", "^namespace: 'a//b' is not a namespace"),
        ([], "a" * 64, "^namespace: 'a+' is not a namespace.* at most 64 characters"),
        (["-r", "__ns:=/a-b"], None, "^--ros-args -r __ns: '/a-b' is not a namespace"),
        (["-r", "__ns:=/a"], "b", "^the graph is given two namespaces: /b and /a"),
        (
            ["-r", "__node:=x"],
            None,
            "^--ros-args -r __node:=x: all nodes would have this name",
        ),
    ],
)
def test_bad_namespaces_and_rules_are_refused(words: list[str], namespace: str | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        RosArguments.parse(words, namespace)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-r", "x"], r"^--ros-args: Couldn't parse remap rule: '-r x'$"),
        (["--fo"], r"^--ros-args: ROS knows no \['--fo'\]$"),
        (
            ["--params-file", "/no"],
            r"^--ros-args: Couldn't parse params file: '--params-file /no'. Error",
        ),
        (["-p"], "^--ros-args: Couldn't parse trailing -p flag."),
    ],
)
def test_arguments_that_ros_does_not_understand_are_refused(words: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        RosArguments.parse(words).require_valid()
