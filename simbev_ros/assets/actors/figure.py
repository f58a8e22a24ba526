"""People: the proportions of a figure, as data, and the solids and parts of its body in a pose."""

from typing import Literal

import numpy as np

from simbev_ros.assets.actor_model import Part
from simbev_ros.assets.actors.pose import Gait, Pose, Seat, Swing, seated_pose, walking_pose
from simbev_ros.assets.actors.solids import Box, Ellipsoid, Rings, Solid, Tube, Vector
from simbev_ros.config.base import Model
from simbev_ros.types import Float64Array


class Figure(Model):
    """A person.

    Attributes:
        height: Standing, metres; the blueprint's size has the last word.
        girth: Thickness of trunk and limbs over that of a slim adult.
        shoulders: Half the distance of the shoulders over the height.
        head: Size of the head over an adult's, relative to the height.
        belly: How far the waist comes forward, over the height.
        skin: Colour, RRGGBB.
        hair: Colour, RRGGBB.
        hairstyle: Or what the person wears on the head.
        top: Finish of the upper garment.
        hem: How far the upper garment reaches below the hip joints, over the height.
        short_sleeves: The forearms are bare.
        bottom: Finish of the trousers.
        shoes: Finish of the shoes.
        gait: How a walker moves.
        seat: How a rider sits.
    """

    height: float
    girth: float = 1.0
    shoulders: float = 0.112
    head: float = 1.0
    belly: float = 0.0
    skin: str
    hair: str
    hairstyle: Literal["short", "long", "bun", "cap", "cycle_helmet", "full_helmet"]
    top: str = "clothes"
    hem: float = 0.01
    short_sleeves: bool = False
    bottom: str
    shoes: str
    gait: Gait | None = None
    seat: Seat | None = None


# Rings of the trunk above the hip joints and of the head about its centre: z, x, half depth, half width; over the height.
_HIPS = [(-0.06, 0.0, 0.040, 0.070), (-0.03, -0.004, 0.064, 0.094), (0.0, -0.004, 0.068, 0.099), (0.05, 0.0, 0.048, 0.078)]
_TRUNK = [
    (0.06, 0.002, 0.060, 0.089),
    (0.10, 0.002, 0.058, 0.088),
    (0.16, 0.0, 0.064, 0.098),
    (0.22, -0.002, 0.067, 0.108),
    (0.252, -0.006, 0.060, 0.113),
    (0.276, -0.010, 0.048, 0.098),
    (0.296, -0.011, 0.038, 0.066),
    (0.312, -0.010, 0.028, 0.038),
]
_HEAD = [
    (-0.068, 0.014, 0.022, 0.020),
    (-0.050, 0.006, 0.044, 0.034),
    (-0.018, 0.0, 0.053, 0.041),
    (0.018, -0.003, 0.056, 0.044),
    (0.045, -0.005, 0.047, 0.038),
    (0.063, -0.006, 0.024, 0.020),
]
_SHOE = [(-0.039, 0.036, 0.074, 0.026), (-0.024, 0.036, 0.075, 0.028), (-0.008, 0.014, 0.046, 0.026), (0.012, 0.0, 0.027, 0.025)]
_SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")


def figure_pose(figure: Figure) -> Pose:
    """The pose in which the figure is modelled."""
    if figure.seat is not None:
        return seated_pose(figure.seat, figure.height, figure.shoulders)
    assert figure.gait is not None, "a figure walks or sits"
    return walking_pose(figure.gait, figure.height, figure.shoulders)


def figure_parts(pose: Pose, first: int) -> list[Part]:
    """Thigh, shin, foot, upper arm and forearm of both sides; ``first`` is the index of the first of them."""
    parts: list[Part] = []
    for side in _SIDES:
        thigh = first + len(parts)
        joints = pose.joints[side]
        parts += [
            _part(f"thigh {side}", 0, joints["hip"], pose.swings[side]["thigh"], lift_m=pose.lift_m),
            _part(f"shin {side}", thigh, joints["knee"], pose.swings[side]["shin"]),
            _part(f"foot {side}", thigh + 1, joints["ankle"], pose.swings[side]["foot"]),
            _part(f"upper arm {side}", 0, joints["shoulder"], pose.swings[side]["upper arm"]),
            _part(f"forearm {side}", thigh + 3, joints["elbow"], pose.swings[side]["forearm"]),
        ]
    return parts


def _part(name: str, parent: int, pivot_m: Float64Array, swing: Swing, lift_m: float = 0.0) -> Part:
    """A limb."""
    x, y, z = pivot_m.tolist()
    return Part(
        name=name,
        parent=parent,
        pivot_m=(x, y, z),
        swing_rad=swing.amplitude_rad,
        swing_phase_rad=swing.phase_rad,
        swing_offset_rad=swing.offset_rad,
        still_rad=swing.still_rad,
        lift_m=lift_m,
    )


def figure_solids(figure: Figure, pose: Pose) -> list[Solid]:
    """The body, dressed, in its pose."""
    solids = [*_trunk(figure, pose), *_head(figure, pose)]
    for side in _SIDES:
        solids += [*_leg(figure, pose, side), *_arm(figure, pose, side)]
    return solids


def _trunk(figure: Figure, pose: Pose) -> list[Solid]:
    """Hips, upper garment and neck."""
    h, girth = figure.height, figure.girth
    hem = [(-figure.hem, -0.003, 0.074 + 0.25 * figure.hem, 0.104 + 0.15 * figure.hem), (0.0, -0.003, 0.074, 0.104)]
    waist = [(z, x + figure.belly * (z < 0.2), dx + figure.belly * (z < 0.2), dy) for z, x, dx, dy in _TRUNK[:3]]
    chest = [(z, x, dx, dy * figure.shoulders / 0.112) for z, x, dx, dy in _TRUNK[3:]]
    place = {"at": _vector(pose.hip), "turn": (0.0, pose.lean_deg, 0.0)}
    trunk = [
        Rings(shape="rings", finish=figure.bottom, rings=_rings(_HIPS, h, girth), **place),
        Rings(shape="rings", finish=figure.top, rings=_rings(hem + waist + chest, h, girth), segments=12, **place),
    ]
    neck = (pose.neck, pose.head - np.array([0.0, 0.0, 0.03 * h]))
    return [*trunk, _limb(f"skin #{figure.skin}", "body", *neck, [0.034 * h, 0.031 * h], girth, rounded=False)]


def _head(figure: Figure, pose: Pose) -> list[Solid]:
    """Head with face, and hair or headgear."""
    size = figure.height * figure.head
    center = pose.head
    skin, hair = f"skin #{figure.skin}", f"hair #{figure.hair}"
    solids: list[Solid] = []
    if figure.hairstyle != "full_helmet":
        solids.append(Rings(shape="rings", finish=skin, rings=_rings(_HEAD, size), at=_vector(center)))
        nose = center + size * np.array([0.055, 0.0, -0.014])
        solids.append(Box(shape="box", finish=skin, size=_vector(size * np.array([0.014, 0.013, 0.026])), at=_vector(nose)))
        for side in (-1.0, 1.0):
            eye = center + size * np.array([0.0525, side * 0.017, 0.004])
            solids.append(Box(shape="box", finish="eye", size=_vector(size * np.array([0.006, 0.013, 0.007])), at=_vector(eye)))

    def blob(finish: str, extent: Vector, offset: Vector) -> Ellipsoid:
        at = _vector(center + size * np.array(offset))
        return Ellipsoid(shape="ellipsoid", finish=finish, size=_vector(size * np.array(extent)), at=at, segments=9)

    if figure.hairstyle in ("short", "long", "bun"):
        solids.append(blob(hair, (0.116, 0.100, 0.110), (-0.014, 0.0, 0.020)))
    if figure.hairstyle == "long":
        solids.append(blob(hair, (0.070, 0.108, 0.190), (-0.032, 0.0, -0.040)))
    if figure.hairstyle == "bun":
        solids.append(blob(hair, (0.045, 0.045, 0.045), (-0.065, 0.0, 0.045)))
    if figure.hairstyle == "cap":
        solids.append(blob(hair, (0.106, 0.096, 0.09), (-0.018, 0.0, 0.005)))
        solids.append(blob("clothes", (0.120, 0.102, 0.080), (-0.006, 0.0, 0.036)))
        solids.append(blob("clothes", (0.075, 0.080, 0.012), (0.058, 0.0, 0.034)))
    if figure.hairstyle == "cycle_helmet":
        solids.append(blob(hair, (0.108, 0.094, 0.09), (-0.012, 0.0, 0.005)))
        solids.append(blob("white", (0.150, 0.112, 0.090), (-0.010, 0.0, 0.042)))
    if figure.hairstyle == "full_helmet":
        solids.append(blob("clothes", (0.150, 0.135, 0.155), (-0.004, 0.0, 0.0)))
        solids.append(blob("glass", (0.080, 0.122, 0.058), (0.038, 0.0, 0.008)))
        solids.append(blob("black", (0.100, 0.090, 0.060), (0.012, 0.0, -0.055)))
    return solids


def _leg(figure: Figure, pose: Pose, side: Literal["left", "right"]) -> list[Solid]:
    """Thigh, shin and shoe."""
    h, girth, joints = figure.height, figure.girth, pose.joints[side]
    thigh = [0.047 * h, 0.046 * h, 0.038 * h, 0.033 * h]
    shin = [0.033 * h, 0.032 * h, 0.026 * h, 0.024 * h]
    pitch = float(np.degrees(pose.foot_pitch_rad[side]))
    shoe = _rings(_SHOE, h, 0.5 + 0.5 * girth)
    return [
        _limb(figure.bottom, f"thigh {side}", joints["hip"], joints["knee"], thigh, girth),
        _limb(figure.bottom, f"shin {side}", joints["knee"], joints["ankle"], shin, girth, rounded=False),
        Rings(
            shape="rings",
            finish=figure.shoes,
            part=f"foot {side}",
            rings=shoe,
            segments=8,
            at=_vector(joints["ankle"]),
            turn=(0.0, pitch, 0.0),
        ),
    ]


def _arm(figure: Figure, pose: Pose, side: Literal["left", "right"]) -> list[Solid]:
    """Upper arm, forearm and hand."""
    h, girth, joints = figure.height, figure.girth, pose.joints[side]
    skin = f"skin #{figure.skin}"
    sleeve = skin if figure.short_sleeves else figure.top
    fore = joints["wrist"] - joints["elbow"]
    hand = joints["wrist"] + fore / np.linalg.norm(fore) * 0.035 * h
    pitch = float(np.degrees(np.arctan2(-fore[0], -fore[2])))
    return [
        _limb(figure.top, f"upper arm {side}", joints["shoulder"], joints["elbow"], [0.033 * h, 0.029 * h, 0.025 * h], girth),
        _limb(sleeve, f"forearm {side}", joints["elbow"], joints["wrist"], [0.025 * h, 0.024 * h, 0.018 * h], girth),
        Ellipsoid(
            shape="ellipsoid",
            finish=skin if pose.bare_hands else "black",
            part=f"forearm {side}",
            size=_vector(h * np.array([0.046, 0.028, 0.098])),
            at=_vector(hand),
            turn=(0.0, pitch, 0.0),
            segments=7,
            rings=4,
        ),
    ]


def _limb(
    finish: str, part: str, start: Float64Array, end: Float64Array, radii: list[float], girth: float, rounded: bool = True
) -> Tube:
    """A limb from joint to joint with radii at equal distances; rounded ends reach half a radius past the joints."""
    share = np.linspace(0.0, 1.0, len(radii))
    radii = [radius * girth for radius in radii]
    if rounded:
        length = float(np.linalg.norm(end - start))
        share = np.concatenate([[-0.6 * radii[0] / length], share, [1.0 + 0.6 * radii[-1] / length]])
        radii = [0.6 * radii[0], *radii, 0.6 * radii[-1]]
    points = start + share[:, None] * (end - start)
    path = tuple((*point.tolist(), radius) for point, radius in zip(points, radii, strict=True))
    return Tube(shape="tube", finish=finish, part=part, path=path, segments=8)


def _rings(
    rows: list[tuple[float, float, float, float]], height: float, girth: float = 1.0
) -> tuple[tuple[float, float, float, float, float], ...]:
    """Rings in metres from rows z, x, half depth, half width over the height."""
    return tuple(
        (x * height, 0.0, z * height, depth * height * girth, width * height * girth) for z, x, depth, width in rows
    )


def _vector(values: Float64Array) -> Vector:
    """Three floats."""
    x, y, z = values.tolist()
    return x, y, z
