"""docs/reference/box-columns.md: columns of every table, and what its numbers mean.

Columns are read from definitions of messages or from the source: the comment next to a column is its description.
"""

import ast
import tokenize
from collections.abc import Iterator, Mapping
from functools import lru_cache
from io import StringIO
from pathlib import Path

import numpy as np

import simbev_ros
from simbev_ros.foundation.semantics import BOX_CLASSES, CLASSES
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.legend import legend
from tools.docs.interfaces import message_fields_of
from tools.docs.markdown import GENERATED, code, sentence, table

TABLES: Mapping[str, tuple[str, str]] = {
    "BOX_DTYPE": ("Boxes", '`/ego/boxes`, `frame["boxes"]`'),
    "TOGETHER_DTYPE": (
        "Boxes of several agents",
        '`/world/boxes`, `frame["world/boxes"]`: the columns of [boxes](#boxes) but for those that depend on the '
        "observer (`distance`, `angle`, `visibility`, `lidar_points`, `radar_points`, `on_ego_level`, `valid`, "
        "`difficulty`), then these, then those of each agent. Bits of `seen_by` are in the order of `scene.agents`.",
    ),
    "OBSERVER_DTYPE": (
        "Boxes of several agents: columns of each agent",
        "In `/world/boxes` they begin with the agent's name, as in `car_2.distance`. Its own vehicle, which others may "
        "see, is not in the agent's own boxes.",
    ),
    "V2X_DTYPE": (
        "Messages between agents",
        '`/v2x/<agent>`: what it sends, `frame["v2x/car_2"]`. `/<agent>/v2x`: what arrives at it, `frame["v2x"]`. A '
        "message has a row for the sender itself and one for each box that it sees.",
    ),
    "VIEW_DTYPE": (
        "Views of a camera",
        '`/ego/cam_*/boxes`, `frame["cam_front/boxes"]`. Edges of boxes are the outer edges of their pixels, and pixel '
        "centers are at integers: the box around the single pixel in column 7 and row 3 is 6.5, 2.5, 7.5, 3.5.",
    ),
    "ACTOR_DTYPE": ("Actors", "`/world/actors`"),
    "SIGNAL_DTYPE": ("Traffic lights", "`/world/signals`"),
    "STREET_LIGHT_DTYPE": ("Street lights", "`/world/lights`"),
    "POINT_DTYPE": ("Lidar points", "`/ego/lidar/points`"),
    "SEMANTIC_POINT_DTYPE": ("Semantic lidar points", "`/ego/lidar/semantic_points`"),
    "RADAR_POINT_DTYPE": ("Radar points", "`/ego/radar_*/points`"),
    "RADAR_RCS_DTYPE": (
        "Radar points: columns of radars with a detector",
        "The columns of [radar points](#radar-points), then these. ARS408-21 measures no elevations: they are 0.",
    ),
    "VOXEL_DTYPE": ("Occupied voxels", "`/ego/occupancy/points`"),
}
"""Name of the dtype in the code → heading, and where the table is found."""

_MESSAGES = {"BOX_DTYPE": "Box", "VIEW_DTYPE": "View", "ACTOR_DTYPE": "Actor", "SIGNAL_DTYPE": "TrafficSignal"}
"""Name of the dtype → message that has its columns."""
_NOTE = "; column class of the table"

_INTRODUCTION = """# Columns of boxes and other tables

Tables are published as sensor_msgs/PointCloud2: one row a point, one column a field. The dataset reader gives them as
structured numpy arrays with the same names, types and order.

The numbers that stand for something (classes, tags, bits) are explained at the end of this page. Every bag carries the
same explanation as JSON on `/world/legend`, for readers without this package.
"""


def render_tables() -> str:
    """The whole page."""
    parts = [GENERATED, _INTRODUCTION]
    for name, (title, where) in TABLES.items():
        rows = _message_rows(_MESSAGES[name]) if name in _MESSAGES else _merged(columns_of(name))
        parts.append(f"## {title}\n\n{where}\n\n{table(('column', 'type', 'meaning'), rows)}")
    parts += _legend()
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def _message_rows(message: str) -> Iterator[tuple[str, str, str]]:
    for names, kind, text in message_fields_of(message):
        yield " ".join(map(code, names)).replace("class_id", "class"), kind, sentence(text.removesuffix(_NOTE))


def columns_of(name: str) -> list[tuple[str, str, str]]:
    """Name, numpy type and description of each column of a dtype of the package; a description may be empty.

    Raises:
        LookupError: No module defines this dtype.
    """
    for path, source in _sources():
        if f"\n{name} = np.dtype(" not in source:
            continue
        for node in ast.walk(ast.parse(source, str(path))):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == name:
                assert isinstance(node.value, ast.Call)
                comments = _comments(source)
                pairs = [(each.lineno, *ast.literal_eval(each)) for each in _elements(node.value.args[0])]
                return [(column, kind, comments.get(line, "")) for line, column, kind in pairs]
    raise LookupError(f"no module defines {name}")


def _elements(node: ast.expr) -> list[ast.expr]:
    assert isinstance(node, ast.List)
    return node.elts


@lru_cache(maxsize=1)
def _sources() -> list[tuple[Path, str]]:
    folder = Path(str(simbev_ros.__file__)).parent
    return [(path, path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.py"))]


def _comments(source: str) -> dict[int, str]:
    """Comment of each line that has one."""
    tokens = tokenize.generate_tokens(StringIO(source).readline)
    return {each.start[0]: each.string.lstrip("# ") for each in tokens if each.type == tokenize.COMMENT}


def _merged(columns: list[tuple[str, str, str]]) -> Iterator[tuple[str, str, str]]:
    """Rows of the table; a column without a description joins the one before."""
    rows: list[tuple[list[str], str, str]] = []
    for name, kind, text in columns:
        if rows and not text and rows[-1][1] == kind:
            rows[-1][0].append(name)
        else:
            rows.append(([name], kind, text))
    for names, kind, text in rows:
        yield " ".join(map(code, names)), np.dtype(kind).name, sentence(text)


def _legend() -> Iterator[str]:
    """Sections that explain numbers."""
    known = legend()
    lists = (
        ("Classes of boxes", "Column `class`.", known["box_classes"]),
        ("Classes of the grid", "Bit k of a cell of `/ego/bev/labels` is class k.", known["bev_classes"]),
        ("Difficulties", "Column `difficulty`.", known["difficulties"]),
        ("Kinds of signs", "Column `sign`; the first one means no sign.", known["sign_types"]),
    )
    for title, text, names in lists:
        rows = [(str(index), code(name)) for index, name in enumerate(names)]
        yield f"## {title}\n\n{text}\n\n{table(('number', 'name'), rows)}"
    yield f"## Difficulty by distance and points\n\n{_difficulty()}"
    numbers = (
        (
            "Semantic tags",
            "Column `tag`, pixels of semantic images. The numbering is CARLA's, as are the colors in pictures (its "
            "Cityscapes palette).",
            known["tags"],
        ),
        ("States of traffic lights", "Column `state`.", known["signal_states"]),
        ("Bits of lights", "Column `lights`.", known["light_bits"]),
        ("Bits of behavior", "Column `behavior`.", known["behavior_bits"]),
    )
    for title, text, values in numbers:
        rows = [(str(value), code(name)) for name, value in values.items()]
        yield f"## {title}\n\n{text}\n\n{table(('value', 'name'), rows)}"
    yield f"## Catalog\n\nColumn `blueprint` is the index in this list.\n\n{_catalog()}"


def _difficulty() -> str:
    limits = {name: CLASSES[name] for name in BOX_CLASSES}
    rows = [
        (code(name), *(f"≥ {distance} m, or < {points} points" for distance, points in (each["hard"], each["medium"])))
        for name, each in limits.items()
    ]
    text = "A box is *hard* or *medium* at a distance or with few lidar and radar points; else it is *easy*."
    return f"{text}\n\n{table(('class', 'hard', 'medium'), rows)}"


def _catalog() -> str:
    rows = [
        (
            str(index),
            code(each.name),
            each.tag.name.lower(),
            each.box_class or "–",
            " × ".join(f"{size:g}" for size in each.size_m),
        )
        for index, each in enumerate(load_blueprints())
    ]
    return table(("index", "name", "tag", "class of box", "length × width × height (m)"), rows)
