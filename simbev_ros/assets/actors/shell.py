"""Shells: the smooth bodies of vehicles, lofted through waterlines from the sill to the roof, closed by a crowned cap.

A waterline is a loop at (nearly) one height, the same left and right. Half of it has three stretches: the front, from
its middle to where the side starts; the side; and the rear, to its middle. A column is a point that all loops have, so
that lamps, windows, grilles and seams are patches of the grid loops x columns.
"""

from typing import Literal

from simbev_ros.config.base import Model

Curve = float | tuple[tuple[float, float], ...]
"""A constant, or points (x, value) of a smooth curve along the vehicle."""


class Loop(Model):
    """One waterline; meters, actor frame.

    Attributes:
        name: By which patches name it.
        z: Height.
        half: Half of the width.
        front: x of its foremost point, in the middle.
        rear: x of its rearmost point.
        sides: Where this loop has the shell's ``sides``; the same places when omitted.
        nose: Exponent of the front's superellipse: 2 is round, 6 is boxy.
        tail: Exponent of the rear's.
    """

    name: str
    z: Curve
    half: Curve
    front: float
    rear: float
    sides: tuple[float, ...] | None = None
    nose: float = 3.0
    tail: float = 3.0


class Area(Model):
    """Cells of a shell.

    Attributes:
        rows: The loops below and above, by name; none for the cap.
        front: Ranges [from, to, from, to, ...] of the front stretch, 0 in the middle, 1 where the side starts.
        side: Ranges of x, front to rear, as the shell's ``sides`` count it.
        rear: Ranges of the rear stretch, 0 where the side ends, 1 in the middle.
        lateral: Range of |y| over the half width, on the cap.
        only: One side of the vehicle.
    """

    rows: tuple[str, str] | None = None
    front: tuple[float, ...] = ()
    side: tuple[float, ...] = ()
    rear: tuple[float, ...] = ()
    lateral: tuple[float, float] = (0.0, 1.0)
    only: Literal["left", "right"] | None = None


class Patch(Area):
    """Cells that get another finish, see finishes.yaml; ``turn_left`` becomes ``turn_right`` on the right."""

    finish: str


class Panel(Area):
    """Cells that belong to a door, left and right.

    Attributes:
        door: Its name.
        rim: The cap above the panel belongs to the door beyond this share of the half width.
    """

    door: str
    rim: float | None = None


class Seam(Model):
    """A shut line: an upright one between two loops, or a level one below a loop.

    Attributes:
        rows: The loops between which it is upright; none for a level one.
        below: The loop below which it is level.
        front: Where it is upright, or ranges where it is level; see ``Area``.
        side: See ``front``.
        rear: See ``front``.
        only: One side of the vehicle.
    """

    rows: tuple[str, str] | None = None
    below: str = ""
    front: tuple[float, ...] = ()
    side: tuple[float, ...] = ()
    rear: tuple[float, ...] = ()
    only: Literal["left", "right"] | None = None


class Arch(Model):
    """A wheel arch: the shell's lower edge rises to this circle."""

    x: float
    z: float
    radius: float


class Recess(Model):
    """A sunken piece of the cap, such as a pickup's bed: from x to x, out to a share of the half width, down to z."""

    x: tuple[float, float]
    lateral: float
    z: float


class Shell(Model):
    """A body; see the module.

    Attributes:
        loops: From the lowest up. With arches the first two are the floor's edge and the inner edge of the wheel wells.
        patches: Later ones win.
        panels: What of the shell belongs to doors.
        seams: Shut lines.
        sides: x where the side starts, of places between that loops may move, and where it ends.
        finish: Where there is no patch.
        front: Number of cells of the front stretch, besides those that patches ask for.
        side: Number of cells of the side.
        rear: Number of cells of the rear.
        crown: How much higher the cap is in the middle than at its widest edge.
        cap: Finish of the cap.
        base: Finish of the closed bottom.
        arches: Wheel arches.
        recess: A hole in the cap.
        crease_deg: Edges sharper than this stay sharp.
    """

    loops: tuple[Loop, ...]
    patches: tuple[Patch, ...] = ()
    panels: tuple[Panel, ...] = ()
    seams: tuple[Seam, ...] = ()
    sides: tuple[float, ...]
    finish: str = "paint"
    front: int = 3
    side: int = 2
    rear: int = 3
    crown: float = 0.03
    cap: str = "paint"
    base: str = "black"
    arches: tuple[Arch, ...] = ()
    recess: Recess | None = None
    crease_deg: float = 33.0
