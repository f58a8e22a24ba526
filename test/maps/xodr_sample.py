"""Writes small OpenDRIVE files for the tests, from one road or several."""

from collections.abc import Iterable

from simbev_ros.maps.safe_xml import LinedElement

LINE = "<line/>"
FLAT_HEADER = (
    '<header revMajor="1" revMinor="4" name="" vendor="">'
    "<geoReference><![CDATA[+proj=tmerc +lat_0=48 +lon_0=9 +k=1 +x_0=0 +y_0=0 +datum=WGS84]]></geoReference></header>"
)
CENTER = '<center><lane id="0" type="none"/></center>'


def geometry(shape: str, length: float, s: float = 0.0, x: float = 0.0, y: float = 0.0, hdg: float = 0.0) -> str:
    return f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{hdg!r}" length="{length!r}">{shape}</geometry>'


def cubic(tag: str, a: float, b: float = 0.0, c: float = 0.0, d: float = 0.0, **start: float) -> str:
    starts = " ".join(f'{name}="{value!r}"' for name, value in (start or {"s": 0.0}).items())
    return f'<{tag} {starts} a="{a!r}" b="{b!r}" c="{c!r}" d="{d!r}"/>'


def width(a: float, b: float = 0.0, c: float = 0.0, d: float = 0.0, at: float = 0.0) -> str:
    return cubic("width", a, b, c, d, sOffset=at)


def lane(number: int, kind: str = "driving", inner: str = "", attributes: str = "") -> str:
    content = inner if "<width" in inner or "<border" in inner else width(3.5) + inner
    return f'<lane id="{number}" type="{kind}" {attributes}>{content}</lane>'


def linked(before: int, after: int) -> str:
    return f'<link><predecessor id="{before}"/><successor id="{after}"/></link>'


def section(*lanes: str, s: float = 0.0, center: str = CENTER, attributes: str = "") -> str:
    left = "".join(item for item in lanes if 'id="-' not in item)
    right = "".join(item for item in lanes if 'id="-' in item)
    sides = (f"<left>{left}</left>" if left else "") + center + (f"<right>{right}</right>" if right else "")
    return f'<laneSection s="{s!r}" {attributes}>{sides}</laneSection>'


def road(
    plan: str,
    length: float,
    sections: str | Iterable[str] = "",
    number: str = "1",
    links: str = "",
    more: str = "",
    offset: str = "",
    attributes: str = "",
    junction: str = "-1",
) -> str:
    lanes = "".join(sections) or section(lane(-1))
    return (
        f'<road id="{number}" length="{length!r}" junction="{junction}" {attributes}><link>{links}</link>'
        f"<planView>{plan}</planView>{more}<lanes>{offset}{lanes}</lanes></road>"
    )


def xodr(*content: str, header: str = FLAT_HEADER) -> str:
    return f'<?xml version="1.0"?>\n<OpenDRIVE>{header}{"".join(content)}</OpenDRIVE>\n'


def straight_road(length: float = 100.0, **arguments: str) -> str:
    return road(geometry(LINE, length), length, **arguments)  # type: ignore[arg-type]


def element(tag: str = "geometry") -> LinedElement:
    made = LinedElement(tag)
    made.line = 1
    return made
