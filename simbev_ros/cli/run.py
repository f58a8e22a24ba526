"""``simbev run``: streams the scenes of a configuration from a graph, with or without recording."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console

from simbev_ros.cli.console import make_console, own_command
from simbev_ros.cli.evaluate.live import FiguresOption, StackOption, with_evaluation
from simbev_ros.cli.ros_options import NamespaceOption, ros_arguments
from simbev_ros.cli.scene_options import Config, Live
from simbev_ros.cli.view.beside_run import ViewOption, ViewPortOption, viewer_beside
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from simbev_ros.config.scenario import Scenario


Record = Annotated[Path | None, typer.Option(help="Record each scene as a bag in this dataset folder.")]
Domain = Annotated[int | None, typer.Option(help="ROS domain; default: ROS_DOMAIN_ID, or 0.", min=0, max=232)]
Network = Annotated[
    bool, typer.Option("--network", help="Let other hosts take part; by default the graph is on this one alone.")
]
Security = Annotated[
    bool, typer.Option("--security", help="Encrypt with keys that are made for this run (needs SROS 2).")
]
Reliable = Annotated[
    bool, typer.Option("--reliable", help="With --live: sensor topics are reliable, for subscribers with default QoS.")
]
PaceOption = Annotated[
    Literal["real-time", "auto"],
    typer.Option(
        "--pace", help="With --live; auto: the clock slows down when this machine cannot keep up, and nothing is lost."
    ),
]
Serve = Annotated[
    bool, typer.Option("--serve", help="Play the scenes that ROS nodes ask for (/world/load_scene, /world/run_scene).")
]


def run(
    context: typer.Context,
    config: Config,
    live: Live = False,
    reliable: Reliable = False,
    pace: PaceOption = "real-time",
    record: Record = None,
    domain: Domain = None,
    network: Network = False,
    security: Security = False,
    namespace: NamespaceOption = None,
    serve: Serve = False,
    evaluate: FiguresOption = None,
    stack: StackOption = None,
    view: ViewOption = False,
    view_port: ViewPortOption = None,
) -> None:
    """Start the graph and stream, until Ctrl-C or until the scenes end.

    What follows --ros-args goes to all nodes: remapping, parameters, files of parameters, log levels.

    [bold]Examples[/]

    simbev run live --live                       stream in real time

    simbev run live --live --reliable            and for subscribers with ROS's default QoS, such as RViz's displays

    simbev run live --live --pace auto           in real time, or slower if need be, without loss

    simbev run my.yaml --record datasets/first   as fast as it goes, every message recorded

    simbev run my.yaml --stack reference --evaluate figures.json

    simbev run my.yaml --stack "baseline-lidar runs/mine/model.onnx"

    simbev run my.yaml --stack "baseline-lidar --track" --evaluate figures.json

    simbev run cut_in.xosc --record out --view   a scenario of OpenSCENARIO, watched in the browser

    simbev run live --live --ros-args -r /ego/lidar/points:=/points

    simbev run my.yaml --serve                   scenes on request: a service, and an action
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from simbev_ros.production.observer import SeveralObservers
    from simbev_ros.production.play import play_scenes
    from simbev_ros.production.serve import serve_scenes
    from simbev_ros.ros.graph.exposure import Exposure

    ros, console = ros_arguments(context, namespace), make_console()
    scenario = with_evaluation(load_scenario(config), evaluate, stack or ())
    scenario, live = _with_live_options(scenario, live=live, reliable=reliable, slows=pace == "auto")
    domain = 0 if domain is None and not os.environ.get("ROS_DOMAIN_ID") else domain
    _print_environment(domain, console, network=network)
    with viewer_beside(view_port, console, wanted=view, network=network, ros=ros) as viewer:
        observer = SeveralObservers(SceneDisplay(console), viewer)
        where: dict[str, Any] = {"domain": domain, "exposure": Exposure(network=network, security=security), "ros": ros}
        play = serve_scenes if serve else play_scenes
        for bag in play(scenario, live=live, dataset=record, **where, observer=observer):
            console.print(f"recorded {bag}", soft_wrap=True)


def _with_live_options(scenario: "Scenario", *, live: bool, reliable: bool, slows: bool) -> tuple["Scenario", bool]:
    """The configuration with the options of real time, and whether nodes skip ticks; a clock that slows is lockstep."""
    changes: dict[str, Any] = {}
    if reliable:
        if not live:
            raise InputError("--reliable: is for --live; in lockstep, all topics are reliable")
        changes["live_reliability"] = "reliable"
    if slows:
        if not live:
            raise InputError("--pace auto: is for --live; in lockstep, the clock always waits for the slowest node")
        changes["max_real_time_factor"] = scenario.graph.max_real_time_factor or 1.0
    graph = scenario.graph.model_copy(update=changes)
    return scenario.model_copy(update={"graph": graph}), live and not slows


def _print_environment(domain: int | None, console: Console, *, network: bool) -> None:
    """Print what nodes in other shells need to take part, and which message packages are missing."""
    from simbev_ros.foundation.installation.message_packages.installer import describe_remedy, survey_packages

    command = _env_command(domain, network)
    console.print(f"subscribers: source <({command})", style="dim", highlight=False, soft_wrap=True)
    if lacking := [state.package.use for state in survey_packages() if not state.is_there]:
        console.print(f"not available: {'; '.join(lacking)}. {describe_remedy()}", style="dim", soft_wrap=True)


def _env_command(domain: int | None, network: bool) -> str:
    """Command for other shells: prints the variables with which their nodes find this graph."""
    options = [*(["--domain", str(domain)] if domain else []), *(["--network"] if network else [])]
    return " ".join([own_command(), "env", *options])
