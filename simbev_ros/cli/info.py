"""``simbev info``: prints the content of a bag or a dataset."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from simbev_ros.cli.agent_option import require_agent
from simbev_ros.cli.console import counting_bar, format_size, make_console, percent_bar, table_console
from simbev_ros.cli.output_file import make_room, require_name, require_place
from simbev_ros.cli.pool import Workers, processes
from simbev_ros.dataset.parallel import Pool
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath, path_or_url
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.layout import PARTIAL_SUFFIX, finished_scenes, is_dataset, is_scene, scenes_of
from simbev_ros.scene.ending import DURATION

_STATE_STYLES = {"finished": "green", "unfinished": "yellow", "cut off": "red", "damaged": "red"}
_MAX_PROBLEMS = 5
_SHORT = 16
"""Number of hexadecimal digits of a hash that are printed."""


def info(
    path: Annotated[
        str,
        typer.Argument(help="A scene's bag, its .mcap file, or a dataset; also as s3://bucket/prefix.", metavar="PATH"),
    ],
    digest: Annotated[bool, typer.Option("--digest", help="One hash per topic over all payloads and stamps.")] = False,
    agent: Annotated[
        str | None,
        typer.Option(help="Only the rig and the topics of this agent of a bag.", metavar="NAME", show_default=False),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
    report: Annotated[
        Path | None,
        typer.Option(
            help="Also write pages to browse: scenes, videos, statistics; as FILE.html or FOLDER/index.html.",
            metavar="FOLDER|FILE.html",
        ),
    ] = None,
    videos: Annotated[bool, typer.Option(help="Make a short video of each scene for the report.")] = True,
    workers: Workers = None,
) -> None:
    """Print the content of a recorded scene, finished or not, or of a dataset.

    [bold]Examples[/]

    simbev info out/demo

    simbev info out/demo/scenes/train/Blocks-0000 --digest

    simbev info out/demo/scenes/train/Blocks-0000 --agent ego

    simbev info datasets/first --report first

    simbev info s3://bucket/datasets/first
    """
    pool = processes(workers)
    place = path_or_url(path)
    if agent is not None and (report is not None or is_dataset(place)):
        raise InputError(f"--agent {agent!r:.80}: is for a scene's bag, without --report")
    page = None if report is None else _page(report)
    if is_dataset(place):
        facts, parts = _describe_dataset(place, digest)
    else:
        facts = _describe(place, digest)
        if agent is not None:
            facts = _facts_of_agent(facts, agent)
        parts = [_fact_table(facts), _topic_table(facts["topics"], digest)]
    if as_json:
        print(json.dumps(facts, indent=2))
    else:
        table_console().print(*parts, sep="\n")
    if page is not None:
        _write_report(place, page, pool, videos=videos)


def _describe_dataset(place: AnyPath, digest: bool) -> tuple[dict[str, Any], list[Text | Table]]:
    """Facts of a dataset, and how they are printed."""
    bags = _bags_of(place)
    scenes = [_describe_any(bag, digest) for bag in bags]
    own = {str(bag) for bag in bags if is_scene(bag) or bag.name.endswith(PARTIAL_SUFFIX)}
    finished = sum(scene["state"] == "finished" and scene["path"] in own for scene in scenes)
    additional = sum(map(len, finished_scenes(place).values())) if isinstance(place, Path) else 0
    more = f", {additional} additional bags" if additional else ""
    missing = _planned_scenes(place) - {bag.name.removesuffix(PARTIAL_SUFFIX) for bag in bags}
    head = Text.assemble((str(place), "bold"), f": {finished} of {len(own) + len(missing)} scenes finished{more}")
    return {"path": str(place), "scenes": scenes, "missing": sorted(missing)}, [head, _scene_table(scenes, digest)]


def _planned_scenes(dataset: AnyPath) -> set[str]:
    """Names of the scenes in the plan; none if the plan is damaged, as ``verify`` says."""
    from simbev_ros.dataset.plan import Plan

    try:
        return {entry.name for entry in Plan.load(dataset).scenes}
    except InputError:
        return set()


def _bags_of(dataset: AnyPath) -> Sequence[AnyPath]:
    from simbev_ros.dataset.index import indexed_bags

    return [*indexed_bags(dataset)] if isinstance(dataset, ObjectPath) else scenes_of(dataset)


def _page(report: Path) -> Path:
    """The page that ``--report`` asks for.

    Raises:
        DiskError: The disk is full.
        InputError: It cannot be written.
    """
    load_extras()["sim"].require("simbev info --report")
    from simbev_ros.show.pages.dataset_pages import require_files_folder

    if report.suffix.lower() in (".html", ".htm"):
        page = report
        require_place(page)
    else:
        require_name(report)
        if report.exists() and not report.is_dir():
            raise InputError(f"{report}: is a file; allowed: a folder, or a name that ends in .html")
        page = report / "index.html"
        make_room(report, [page], overwrite=True)
    require_files_folder(page)
    return page


def _write_report(path: AnyPath, page: Path, pool: Pool, *, videos: bool) -> None:
    """Write pages about the finished scenes of a dataset, or about a bag."""
    from simbev_ros.dataset import open_dataset
    from simbev_ros.dataset.statistics import statistics_of
    from simbev_ros.show.pages.dataset_pages import write_pages

    console = make_console(stderr=True, soft_wrap=True)
    with counting_bar("frames", console) as bar:
        statistics = statistics_of(open_dataset(path, threads=1), pool, bar.show)
    with write_errors(page), counting_bar("pages", console) as bar:
        write_pages(statistics, page, pool, bar.show, videos=videos)
    console.print(f"pages in {page}", highlight=False)


def _describe_any(bag: AnyPath, digest: bool) -> dict[str, Any]:
    """Facts of a bag in a dataset; if it cannot be read, only the reason."""
    try:
        return _describe(bag, digest)
    except BagError as error:
        return {"path": str(bag), "name": bag.name, "state": "damaged", "problems": [str(error)]}


def _describe(path: AnyPath, digest: bool) -> dict[str, Any]:
    from simbev_ros.recording.description import describe_bag

    with percent_bar(path.name, make_console(stderr=True), hidden=not digest) as bar:
        return describe_bag(path, digest=digest, progress=bar.show)


def _facts_of_agent(facts: dict[str, Any], agent: str) -> dict[str, Any]:
    """Facts of a bag with the rig and the topics of one agent only. Raises InputError if there is no such agent."""
    scene = facts["scene"] or {"agents": {}}
    require_agent(agent, [*scene["agents"]], facts["name"])
    own = {agent: scene["agents"][agent]}
    topics = [topic for topic in facts["topics"] if topic["name"].startswith(f"/{agent}/")]
    return facts | {"scene": scene | {"rig": own[agent]["rig"], "agents": own}, "topics": topics}


def _fact_table(facts: dict[str, Any]) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    table.add_row("scene", Text(facts["name"], "bold"))
    table.add_row("state", _state(facts))
    if facts["ended"]:
        table.add_row("ended", facts["ended"])
    for problem in facts["problems"][:_MAX_PROBLEMS]:
        table.add_row("", Text(problem, "red"))
    if len(facts["problems"]) > _MAX_PROBLEMS:
        table.add_row("", Text(f"and {len(facts['problems']) - _MAX_PROBLEMS} topics more", "red"))
    table.add_row("length", f"{facts['duration_s']:.2f} s from stamp {facts['start_ns'] / NS_PER_S:.2f} s")
    table.add_row("size", f"{format_size(facts['file_bytes'])}, {facts['messages']} messages")
    if scene := facts["scene"]:
        table.add_row("map", f"{scene['map']}, split {scene['split']}, seed {scene['seed']}")
        part = "" if facts["ticks"] in (None, scene["ticks"]) else f"{facts['ticks']} of "
        table.add_row("ticks", f"{part}{scene['ticks']}, each {scene['tick_s']:g} s")
        table.add_row("actors", f"{scene['vehicles']} vehicles, {scene['pedestrians']} pedestrians")
        table.add_row("weather", _weather(scene))
        _add_rigs(table, scene)
    attachments = ", ".join(f"{name} ({format_size(size)})" for name, size in facts["attachments"].items())
    table.add_row("attached", attachments or "nothing")
    if "digest" in facts:
        table.add_row("digest", facts["digest"][:_SHORT])
    return table


def _add_rigs(table: Table, scene: dict[str, Any]) -> None:
    if len(scene["agents"]) == 1:
        table.add_row("rig", "\n".join(scene["rig"]))
        return
    for name, agent in scene["agents"].items():
        table.add_row(f"rig of {name}", "\n".join([agent["carrier"], *agent["rig"]]))


def _weather(scene: dict[str, Any]) -> str:
    """Each parameter of the weather at the beginning, and at the end if it changes."""
    final = scene["final_weather"] or {}
    return ", ".join(
        f"{key} {value:g}" + (f" → {final[key]:g}" if final else "") for key, value in scene["weather"].items()
    )


def _topic_table(topics: Sequence[dict[str, Any]], digest: bool) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("topic", overflow="fold")
    table.add_column("type", style="dim", overflow="fold")
    for title in ("messages", "rate", "size"):
        table.add_column(title, justify="right", no_wrap=True)
    if digest:
        table.add_column("digest", no_wrap=True)
    for topic in topics:
        count, expected = topic["count"], topic["expected"]
        messages = Text(str(count)) if expected in (None, count) else Text(f"{count} of {expected}", "red")
        rate = f"{topic['rate_hz']:.4g} Hz" if topic["rate_hz"] else ""
        size = format_size(topic["bytes"]) if topic["bytes"] is not None else ""
        hashes = [topic["digest"][:_SHORT]] if digest else []
        table.add_row(topic["name"], topic["type"].replace("/msg/", "/"), messages, rate, size, *hashes)
    return table


def _scene_table(scenes: Sequence[dict[str, Any]], digest: bool) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("scene", overflow="fold")
    table.add_column("state", overflow="fold")
    for title in ("length", "messages", "size"):
        table.add_column(title, justify="right", no_wrap=True)
    if digest:
        table.add_column("digest", no_wrap=True)
    for scene in scenes:
        where = Path(scene["path"])
        name = f"{where.parent.name}/{where.name}"
        if scene["state"] == "damaged":
            problem = scene["problems"][0].removeprefix(scene["path"]).lstrip("/: ")
            table.add_row(name, Text.assemble(("damaged", "red"), f": {problem}"))
            continue
        length = f"{scene['duration_s']:.2f} s"
        hashes = [scene["digest"][:_SHORT]] if digest else []
        table.add_row(name, _state(scene), length, str(scene["messages"]), format_size(scene["file_bytes"]), *hashes)
    return table


def _state(facts: dict[str, Any]) -> Text:
    books = {True: [("complete", "green")], False: [("incomplete", "red")], None: []}[facts["complete"]]
    early = [] if facts["ended"] in (None, DURATION) else [("ended early", "yellow")]
    words = [(facts["state"], _STATE_STYLES[facts["state"]]), *books, *early]
    return Text(", ").join(Text(word, style) for word, style in words)
