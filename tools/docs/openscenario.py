"""docs/reference/openscenario.md: what of OpenSCENARIO is read and done, from the table of elements and the engine."""

from simbev_ros.scene.storyboard.model import SPECS, TABLE, FieldSpec
from simbev_ros.simulation.world.storyboard.actions import MOTIONS
from simbev_ros.simulation.world.storyboard.effects import EFFECTS, GLOBAL_EFFECTS
from tools.docs.markdown import GENERATED, code, table

_INTRODUCTION = """# OpenSCENARIO

Elements of ASAM OpenSCENARIO XML 1.0 to 1.3 that are done, with their attributes. Files of earlier versions are
converted. Others are an error that names file and line, before anything starts. The guide is
[OpenSCENARIO](../guide/openscenario.md).

If its description begins with `CARLA:`, a file is read as CARLA's ScenarioRunner does: y points to the right, and edges
of conditions do not matter. Conditions `criteria_…` of no parameter never hold.
"""
_SHAPES = ("Polyline", "Clothoid", "ClothoidSpline", "Nurbs")
_GROUPS = {"Conditions of entities": "EntityTest", "Conditions of values": "ValueTest", "Positions": "Position"}


def render_openscenario() -> str:
    """The whole page."""
    groups = {
        "Actions that move an entity": (*MOTIONS,),
        "Other actions of an entity": (*EFFECTS,),
        "Global actions": (*GLOBAL_EFFECTS,),
        **{title: tuple(TABLE["unions"][union]) for title, union in _GROUPS.items()},
        "Trajectories": _SHAPES,
    }
    parts = [
        f"## {title}\n\n{table(('element', 'attributes and parts'), map(_row, names))}"
        for title, names in groups.items()
    ]
    return f"{GENERATED}\n{_INTRODUCTION}\n" + "\n".join(parts)


def _row(name: str) -> tuple[str, str]:
    return code(name), ", ".join(code(_part(each)) for each in SPECS[name])


def _part(field: FieldSpec) -> str:
    """Name of an attribute, or of the elements that a field holds."""
    anywhere = {*field.kinds} >= {*TABLE["unions"]["Position"]}
    return field.attribute or field.wrapper or ("Position" if anywhere else " or ".join(field.kinds))
