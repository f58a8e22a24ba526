"""People: what a figure looks like, as data, and the solids and parts of its body in a pose."""

from collections.abc import Iterable
from typing import Literal

import numpy as np

from simbev_ros.assets.actor_model import Part
from simbev_ros.assets.actors.body import Ring, load_body
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
        gloves: Black gloves.
        motion: How a walker moves, or how a rider sits.
    """

    height: float
    girth: float = 1.0
    shoulders: float
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
    gloves: bool = False
    motion: Gait | Seat


_SIDES = ("left", "right")
_SHOULDERS = 0.112
"""The shoulders for which body.yaml has the chest."""


def figure_pose(figure: Figure) -> Pose:
    """The pose in which the figure is modelled."""
    if isinstance(figure.motion, Seat):
        return seated_pose(figure.motion, figure.height, figure.shoulders)
    return walking_pose(figure.motion, figure.height, figure.shoulders)


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
    body, h, girth = load_body(), figure.height, figure.girth
    hem = [(-figure.hem, -0.003, 0.074 + 0.25 * figure.hem, 0.104 + 0.15 * figure.hem), (0.0, -0.003, 0.074, 0.104)]
    waist = [(z, x + figure.belly, depth + figure.belly, width) for z, x, depth, width in body.waist]
    chest = [(z, x, depth, width * figure.shoulders / _SHOULDERS) for z, x, depth, width in body.chest]
    at, turn = _vector(pose.hip), (0.0, pose.lean_deg, 0.0)
    hips, top = _rings(body.hips, h, girth), _rings([*hem, *waist, *chest], h, girth)
    head_base = pose.head - np.array([0.0, 0.0, 0.03 * h])
    return [
        Rings(shape="rings", finish=figure.bottom, rings=hips, at=at, turn=turn),
        Rings(shape="rings", finish=figure.top, rings=top, at=at, turn=turn, segments=12),
        _limb(figure, _own(figure, "skin"), "body", (pose.neck, head_base), body.neck, rounded=False),
    ]


def _head(figure: Figure, pose: Pose) -> list[Solid]:
    """Head with face, and hair or headgear."""
    body, size = load_body(), figure.height * figure.head
    solids: list[Solid] = []
    if figure.hairstyle != "full_helmet":
        skull = _rings(body.head, size)
        solids.append(Rings(shape="rings", finish=_own(figure, "skin"), rings=skull, at=_vector(pose.head)))
        for lump in body.face:
            extent, at = _vector(size * np.array(lump.size)), _vector(pose.head + size * np.array(lump.at))
            solids.append(Box(shape="box", finish=_own(figure, lump.finish), size=extent, at=at))
    for lump in body.hairstyles[figure.hairstyle]:
        extent, at = _vector(size * np.array(lump.size)), _vector(pose.head + size * np.array(lump.at))
        finish = _own(figure, lump.finish)
        solids.append(Ellipsoid(shape="ellipsoid", finish=finish, size=extent, at=at, segments=9))
    return solids


def _leg(figure: Figure, pose: Pose, side: str) -> list[Solid]:
    """Thigh, shin and shoe."""
    body, joints = load_body(), pose.joints[side]
    pitch = float(np.degrees(pose.foot_pitch_rad[side]))
    return [
        _limb(figure, figure.bottom, f"thigh {side}", (joints["hip"], joints["knee"]), body.thigh),
        _limb(figure, figure.bottom, f"shin {side}", (joints["knee"], joints["ankle"]), body.shin, rounded=False),
        Rings(
            shape="rings",
            finish=figure.shoes,
            part=f"foot {side}",
            rings=_rings(body.shoe, figure.height, 0.5 + 0.5 * figure.girth),
            segments=8,
            at=_vector(joints["ankle"]),
            turn=(0.0, pitch, 0.0),
        ),
    ]


def _arm(figure: Figure, pose: Pose, side: str) -> list[Solid]:
    """Upper arm, forearm and hand."""
    body, joints = load_body(), pose.joints[side]
    skin = _own(figure, "skin")
    sleeve = skin if figure.short_sleeves else figure.top
    fore = joints["wrist"] - joints["elbow"]
    hand = joints["wrist"] + fore / np.linalg.norm(fore) * 0.035 * figure.height
    pitch = float(np.degrees(np.arctan2(-fore[0], -fore[2])))
    return [
        _limb(figure, figure.top, f"upper arm {side}", (joints["shoulder"], joints["elbow"]), body.upper_arm),
        _limb(figure, sleeve, f"forearm {side}", (joints["elbow"], joints["wrist"]), body.forearm),
        Ellipsoid(
            shape="ellipsoid",
            finish="black" if figure.gloves else skin,
            part=f"forearm {side}",
            size=_vector(figure.height * np.array(body.hand)),
            at=_vector(hand),
            turn=(0.0, pitch, 0.0),
            segments=7,
            rings=4,
        ),
    ]


def _own(figure: Figure, finish: str) -> str:
    """The finish, with the figure's own skin and hair."""
    return {"skin": f"skin #{figure.skin}", "hair": f"hair #{figure.hair}"}.get(finish, finish)


def _limb(
    figure: Figure,
    finish: str,
    part: str,
    joints: tuple[Float64Array, Float64Array],
    radii: tuple[float, ...],
    rounded: bool = True,
) -> Tube:
    """A limb from joint to joint with radii at equal distances; rounded ends reach half a radius past the joints."""
    start, end = joints
    share = np.linspace(0.0, 1.0, len(radii))
    radius = np.array(radii) * figure.height * figure.girth
    if rounded:
        past = 0.6 * radius[[0, -1]]
        reach = past / np.linalg.norm(end - start)
        share = np.concatenate([[-reach[0]], share, [1.0 + reach[1]]])
        radius = np.concatenate([past[:1], radius, past[1:]])
    points = np.column_stack([start + share[:, None] * (end - start), radius])
    return Tube(shape="tube", finish=finish, part=part, path=tuple(map(tuple, points.tolist())), segments=8)


def _rings(
    rows: Iterable[Ring], height: float, girth: float = 1.0
) -> tuple[tuple[float, float, float, float, float], ...]:
    """Rings in metres from rows of proportions."""
    return tuple(
        (x * height, 0.0, z * height, depth * height * girth, width * height * girth) for z, x, depth, width in rows
    )


def _vector(values: Float64Array) -> Vector:
    """Three floats."""
    x, y, z = values.tolist()
    return x, y, z
