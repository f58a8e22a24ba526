"""Valid maps that ``map_mutations.py`` damages: one or two of each form, small, with much in them."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import osm_sample as osm
import xodr_sample as xodr
from lanelet2_sample import Crossing, LaneletSample
from sumo_nets import generate_net


def sample(suffix: str) -> str:
    """The map whose file name ends in a suffix of ``SUFFIXES``."""
    return _SAMPLES[suffix]()


def _town() -> str:
    """OpenStreetMap: a small town with a river."""
    return osm.SAMPLE.read_text(encoding="utf-8")


def _underground() -> str:
    """OpenStreetMap: a tunnel below a street, a coast, a building with parts, and all kinds of objects."""
    writer = osm.Writer()
    street = {"highway": "residential", "sidewalk": "both", "lanes": "2"}
    writer.way([(0, -160), (0, -60)], street)
    writer.way([(0, -60), (0, 60)], {**street, "tunnel": "yes", "layer": "-1"})
    writer.way([(0, 60), (0, 160)], street)
    writer.way([(-120, 0), (-40, 0), (40, 0), (120, 0)], street)
    writer.way([(-120, 0), (-120, -160), (0, -160)], {**street, "maxspeed": "30 mph"})
    writer.way([(120, 0), (120, 160), (0, 160)], {**street, "tunnel": "building_passage"})
    writer.way([(200, -200), (200, 200)], {"natural": "coastline"})
    corners = [(-60.0, 20.0), (-30.0, 20.0), (-30.0, 45.0), (-60.0, 45.0)]
    writer.ring(corners, {"building": "apartments", "building:levels": "5", "roof:shape": "hipped"})
    writer.ring(
        [(x / 2 - 20, y / 2 + 12) for x, y in corners], {"building:part": "yes", "height": "24", "min_height": "9"}
    )
    writer.ring([(30, -60), (60, -60), (60, -30), (30, -30)], {"amenity": "parking"})
    writer.ring([(30, -100), (80, -100), (80, -70), (30, -70)], {"natural": "water"})
    for row, tags in enumerate(
        ("barrier=wall", "barrier=hedge", "natural=tree_row", "railway=tram", "power=minor_line")
    ):
        key, value = tags.split("=")
        writer.way([(-100, -40 - 9 * row), (-70, -42 - 9 * row), (-30, -38 - 9 * row)], {key: value, "height": "1.5"})
    return writer.text()


def _lanelets() -> str:
    """A crossing of lanelets with lights, walkways and crosswalks, its points given by latitude and longitude."""
    crossing = Crossing(LaneletSample(local=False))
    for arm in range(4):
        crossing.lights(arm)
        crossing.walkways(arm)
        crossing.crosswalk(arm)
    return crossing.sample.text()


def _roads() -> str:
    """OpenDRIVE: a banked road with line, spiral, arc and cubic, on a slope, that leads to a junction with turns."""
    driving = [xodr.lane(number, inner=xodr.linked(number, number)) for number in (1, -1)]
    walks = [xodr.lane(number, "sidewalk", inner=xodr.width(2.0)) for number in (2, -2)]
    lanes = xodr.section(*driving, *walks)
    plan = (
        xodr.geometry(xodr.LINE, 60.0)
        + xodr.geometry('<spiral curvStart="0" curvEnd="0.02"/>', 30.0, s=60.0, x=60.0)
        + xodr.geometry('<arc curvature="0.02"/>', 40.0, s=90.0, x=89.73, y=2.98, hdg=0.3)
        + xodr.geometry(
            '<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.004" dV="0"/>',
            30.0,
            s=130.0,
            x=117.8,
            y=29.6,
            hdg=1.1,
        )
    )
    more = (
        '<elevationProfile><elevation s="0" a="2" b="0.02" c="0" d="0"/><elevation s="80" a="3.6" b="0.02" c="-1e-4" '
        'd="0"/></elevationProfile><lateralProfile><superelevation s="50" a="0.02" b="0" c="0" d="0"/></lateralProfile>'
    )
    objects = (
        '<objects><object id="1" type="crosswalk" s="20" t="0" zOffset="0" hdg="1.57" length="7" width="3"><outline>'
        '<cornerLocal u="-1.5" v="-3.5" z="0"/><cornerLocal u="1.5" v="-3.5" z="0"/>'
        '<cornerLocal u="1.5" v="3.5" z="0"/><cornerLocal u="-1.5" v="3.5" z="0"/></outline></object></objects>'
        '<signals><signal id="2" type="206" s="5" t="-5" orientation="+" dynamic="no"/></signals>'
    )
    link = '<predecessor elementType="junction" elementId="9"/>'
    roads = [xodr.road(plan, 160.0, lanes, number="1", links=link, more=more + objects)]
    for number, (x, y, heading) in {"2": (-30.0, 0.0, 3.14159265), "3": (-15.0, -15.0, -1.57079633)}.items():
        arm = xodr.geometry(xodr.LINE, 70.0, x=x, y=y, hdg=heading)
        roads.append(xodr.road(arm, 70.0, lanes, number=number, links=link))
    turn = '<predecessor elementType="road" elementId="1" contactPoint="start"/>'
    through = turn + '<successor elementType="road" elementId="2" contactPoint="start"/>'
    left = turn + '<successor elementType="road" elementId="3" contactPoint="start"/>'
    inside = [xodr.section(xodr.lane(number, inner=xodr.linked(-number, number))) for number in (-1,)]
    line = xodr.geometry(xodr.LINE, 30.0, hdg=3.14159265)
    arc = xodr.geometry('<arc curvature="0.066666667"/>', 23.5619449, hdg=3.14159265)
    roads.append(xodr.road(line, 30.0, inside, number="4", links=through, junction="9"))
    roads.append(xodr.road(arc, 23.5619449, inside, number="5", links=left, junction="9"))
    connections = "".join(
        f'<connection id="{k}" incomingRoad="1" connectingRoad="{road}" contactPoint="start">'
        '<laneLink from="1" to="-1"/></connection>'
        for k, road in enumerate((4, 5))
    )
    return xodr.xodr(*roads, f'<junction id="9" name="">{connections}</junction>')


def _grid() -> str:
    """A SUMO net of nine junctions with sidewalks, crossings and traffic lights, its streets bent."""
    options = (
        "--grid --grid.number 3 --grid.length 80 -L 2 --sidewalks.guess true --crossings.guess true "
        "--walkingareas true --tls.guess true --perturb-x 6 --perturb-y 6 --seed 3"
    )
    with tempfile.TemporaryDirectory() as folder:
        return generate_net(Path(folder) / "grid.net.xml", *options.split())


def _tunnel() -> str:
    """OpenDRIVE: a road through a tunnel below another one, with raised lanes, lateral shape, and objects."""
    driving = [xodr.lane(number, inner=xodr.linked(number, number)) for number in (1, -1)]
    height = '<height sOffset="0" inner="0.12" outer="0.16"/><height sOffset="90" inner="0" outer="0.1"/>'
    walks = [xodr.lane(number, "sidewalk", inner=xodr.width(2.0) + height) for number in (2, -2)]
    lanes = xodr.section(*driving, *walks)
    low = (
        xodr.cubic("elevation", 0.0),
        xodr.cubic("elevation", 0.0, -0.08, s=20.0),
        xodr.cubic("elevation", -6.4, s=100.0),
    )
    shape = "".join(
        xodr.cubic("shape", a, b, s=s, t=t)
        for s, t, a, b in ((0.0, -6.0, 0.1, -0.02), (0.0, 0.0, 0.0, 0.02), (200.0, -6.0, 0.0, 0.0))
    )
    more = (
        f"<elevationProfile>{''.join(low)}</elevationProfile><lateralProfile>{xodr.cubic('crossfall', 0.02)}{shape}"
        "</lateralProfile>"
    )
    things = "".join(
        f'<object id="{number}" type="{kind}" s="{20.0 * number}" t="{side * 9.0}" zOffset="0" hdg="0.2" {size}>'
        f"{inner}</object>"
        for number, (kind, side, size, inner) in enumerate(_THINGS)
    )
    structures = '<tunnel id="t" s="100" length="80" type="standard"/><bridge id="b" s="240" length="20"/>'
    objects = f"<objects>{things}{structures}</objects>"
    below = xodr.road(xodr.geometry(xodr.LINE, 280.0), 280.0, lanes, more=more + objects)
    plan = xodr.geometry(xodr.LINE, 160.0, x=140.0, y=-80.0, hdg=1.57079633)
    above = xodr.road(
        plan, 160.0, lanes, number="2", more=f"<elevationProfile>{xodr.cubic('elevation', 0.5)}</elevationProfile>"
    )
    return xodr.xodr(below, above)


_OUTLINE = (
    "<outline>"
    + "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="7"/>' for u, v in ((-4, -3), (4, -3), (4, 3), (-4, 3)))
    + "</outline>"
)
_THINGS = (
    ("building", 2, 'length="8" width="6" height="7"', _OUTLINE),
    (
        "barrier",
        1,
        'length="3" width="0.4" height="0.9"',
        '<repeat s="20" length="60" distance="3" tStart="9" tEnd="11"/>',
    ),
    ("tree", -1, 'radius="2" height="8"', '<repeat s="40" length="50" distance="10" tStart="-9" tEnd="-9"/>'),
    ("streetLamp", -1, 'height="6"', ""),
    ("parkingSpace", -1, 'length="5" width="2.5"', ""),
    ("gantry", 0, 'length="0.5" width="12" height="0.6"', ""),
)
"""Type, side (multiple of 9 m), size, and children of objects."""

_SAMPLES: dict[str, Callable[[], str]] = {
    ".osm": _town,
    ".xodr": _roads,
    ".net.xml": _grid,
    ".lanelets.osm": _lanelets,
    ".tunnel.osm": _underground,
    ".tunnel.xodr": _tunnel,
}
SUFFIXES = tuple(_SAMPLES)
