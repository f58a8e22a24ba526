"""Data model of shells: smooth vehicle bodies, lofted through waterlines from sill to roof, closed by a crowned cap.

A waterline is a loop at (nearly) constant height, symmetric left and right. Half of it has three sections: the front,
from the middle to the start of the side; the side; and the rear, to the middle. Columns are points that all loops
have, so that lamps, windows, grilles and seams are patches of the grid loops x columns.
"""

from typing import Literal

from simbev_ros.config.base import Model

Curve = float | tuple[tuple[float, float], ...]
"""A constant, or points (x, value) of a smooth curve along the vehicle."""


class Loop(Model):
    """A waterline of a shell; meters, actor frame.

    Attributes:
        name: Name that patches refer to.
        z: Height: a number, or points (x, z) of a smooth curve along the vehicle.
        half: Half of the width: a number, or points (x, half).
        front: x of the foremost point, in the middle.
        rear: x of the rearmost point.
        sides: x values of this loop that correspond to the shell's ``sides``; equal to them when omitted.
        nose: Exponent of the front's superellipse: 2 is round, 6 is boxy.
        tail: Exponent of the rear's superellipse.
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
    """Range of rows and columns of a shell; patches and panels are areas.

    Attributes:
        rows: Names of the loops below and above; the cap without them.
        front: Ranges [from, to, from, to, ...] of the front section: 0 in the middle, 1 at the start of the side.
        side: Ranges of x, front to rear, in terms of the shell's ``sides``.
        rear: Ranges of the rear section: 0 at the end of the side, 1 in the middle.
        lateral: Range of |y| over the half width, on the cap.
        only: The only side of the vehicle that has the cells; both without it.
    """

    rows: tuple[str, str] | None = None
    front: tuple[float, ...] = ()
    side: tuple[float, ...] = ()
    rear: tuple[float, ...] = ()
    lateral: tuple[float, float] = (0.0, 1.0)
    only: Literal["left", "right"] | None = None


class Patch(Area):
    """Area with another finish.

    Attributes:
        finish: Name of the finish; ``turn_left`` becomes ``turn_right`` on the right.
    """

    finish: str


class Panel(Area):
    """Area that belongs to a door, left and right.

    Attributes:
        door: Name of the door.
        rim: Share of the half width beyond which the cap above the panel belongs to the door.
    """

    door: str
    rim: float | None = None


class Seam(Model):
    """A shut line: vertical between two loops, or horizontal below a loop.

    Attributes:
        rows: Names of the loops that a vertical seam connects; a horizontal one has none.
        below: Name of the loop below which a horizontal seam runs.
        front: Positions of vertical seams, or ranges of a horizontal one, on the front section; see ``Area``.
        side: As ``front``, on the side.
        rear: As ``front``, on the rear section.
        only: The only side of the vehicle that has the seam; both without it.
    """

    rows: tuple[str, str] | None = None
    below: str = ""
    front: tuple[float, ...] = ()
    side: tuple[float, ...] = ()
    rear: tuple[float, ...] = ()
    only: Literal["left", "right"] | None = None


class Arch(Model):
    """Wheel arch: the lower edge of the shell rises to this circle."""

    x: float
    z: float
    radius: float


class Recess(Model):
    """Recessed piece of the cap, such as a pickup's bed: range of x, share of the half width, and z of its floor."""

    x: tuple[float, float]
    lateral: float
    z: float


class Shell(Model):
    """Smooth body of a vehicle, lofted through closed loops from the lowest to the highest, with a crowned cap.

    It is symmetric. Half of a loop has three stretches: the front, from the middle of the nose to the start of the
    side; the side; and the rear, to the middle of the tail. Points along the stretches are columns. So the surface is a
    grid of loops x columns, and lamps, windows, grilles, doors and seams are areas of this grid.

    Attributes:
        loops: Loops from the bottom up. With arches, the first two are the edge of the floor and the inner edge of the
            wheel wells.
        patches: Cells with other finishes; later ones override earlier ones.
        panels: Cells that belong to doors.
        seams: Shut lines.
        sides: x of the start of the side, of points in between that loops may move, and of the end of the side.
        finish: Finish of cells without a patch.
        front: Number of cells of the front section, besides those that patches require.
        side: Number of cells of the side.
        rear: Number of cells of the rear section.
        crown: Height of the cap's middle above its widest edge.
        cap: Finish of the cap.
        base: Finish of the closed bottom.
        arches: Wheel arches.
        recess: Recessed piece of the cap.
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
