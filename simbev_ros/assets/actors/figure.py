"""Human figures: their appearance as data, and the solids and rigid parts of the body in a pose."""

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from simbev_ros.assets.actors.actor_model import Cycle, Part
from simbev_ros.assets.actors.body import Ring, load_body
from simbev_ros.assets.actors.pose import LIMBS, Pose, Seat, seated_pose, standing_pose
from simbev_ros.assets.actors.solids import Box, Ellipsoid, Rings, Solid, Tube, Vector
from simbev_ros.config.base import Model
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.gait import Gait, interpolate_gaits


class Figure(Model):
    """Appearance and posture of a human figure.

    Attributes:
        height: Standing height, meters; the model is scaled to the blueprint's size in the end.
        girth: Thickness of trunk and limbs over that of a slim adult.
        shoulders: Half the shoulder distance over the height.
        head: Relative size of the head over an adult's.
        belly: Forward extent of the waist over the height.
        hairstyle: Hairstyle or headgear.
        top: Finish of the upper garment.
        hem: Length of the upper garment below the hip joints, over the height.
        short_sleeves: Whether the forearms are bare.
        short_trousers: Whether the shins are bare.
        bottom: Finish of the trousers.
        shoes: Finish of the shoes.
        gloves: Whether the hands have black gloves.
        seat: Sitting posture of a rider; None for a figure on foot.
        stoop_deg: Additional forward lean of the trunk on foot.
        elbow_deg: Minimum bend of the elbows on foot.
        arm_swing: Swing of the arms on foot, relative to the usual one.
    """

    height: float
    girth: float = 1.0
    shoulders: float
    head: float = 1.0
    belly: float = 0.0
    hairstyle: Literal["short", "long", "bun", "cap", "cycle_helmet", "full_helmet", "hard_hat"]
    top: str = "clothes"
    hem: float = 0.01
    short_sleeves: bool = False
    short_trousers: bool = False
    bottom: str = "second"
    shoes: str = "shoes"
    gloves: bool = False
    seat: Seat | None = None
    stoop_deg: float = 0.0
    elbow_deg: float = 0.0
    arm_swing: float = 1.0


_SIDES = ("left", "right")
_ROW_PARTS = 6
_ROUND = np.array([0.45, 0.83])
"""Radii toward the rounded end of a limb, over the limb's own radius."""
_SHOULDERS = 0.112
"""Value of ``Figure.shoulders`` that the chest in body.yaml is made for."""


def figure_pose(figure: Figure, tall_m: float) -> Pose:
    """Pose in which a figure is modeled; ``tall_m`` is its height including hair."""
    if figure.seat:
        return seated_pose(figure.seat, figure.height, figure.shoulders)
    x, half = load_body().shoe[0][1:3]
    half *= _shoe_girth(figure)
    gaits = [_own_gait(figure, gait) for gait in interpolate_gaits(_ROW_PARTS)]
    return standing_pose(gaits, figure.height, tall_m, figure.shoulders, (x - half, x + half))


def _own_gait(figure: Figure, gait: Gait) -> Gait:
    """Gait modified by the figure's own posture."""
    return gait.model_copy(
        update={
            "lean": gait.lean + figure.stoop_deg,
            "shoulder": gait.shoulder - figure.stoop_deg,
            "shoulder_swing": gait.shoulder_swing * figure.arm_swing,
            "elbow": max(gait.elbow, figure.elbow_deg),
            "elbow_swing": gait.elbow_swing * figure.arm_swing,
        }
    )


def body_part(pose: Pose) -> Part:
    """Rigid part of the trunk, which leans about the hips."""
    return Part("body", pivot_m=_vector(pose.hip))


def figure_parts(pose: Pose, first: int) -> list[Part]:
    """Rigid parts of both sides: thigh, shin, foot, upper arm and forearm; ``first`` is the index of the first one."""
    parts: list[Part] = []
    for side in _SIDES:
        joints, thigh = pose.joints[side], first + len(parts)
        parts += [
            Part(f"thigh {side}", 0, _vector(joints["hip"])),
            Part(f"shin {side}", thigh, _vector(joints["knee"])),
            Part(f"foot {side}", thigh + 1, _vector(joints["ankle"])),
            Part(f"upper arm {side}", 0, _vector(joints["shoulder"])),
            Part(f"forearm {side}", thigh + 3, _vector(joints["elbow"])),
        ]
    return parts


def figure_cycle(pose: Pose, names: Sequence[str]) -> Cycle:
    """Motion cycle of the parts with these names; only the body and limbs turn."""
    turns = {"body": pose.trunk_rad}
    turns |= {f"{limb} {side}": pose.turn_rad[side][limb] for side in _SIDES for limb in LIMBS}
    still = np.zeros_like(pose.trunk_rad)
    return Cycle(pose.speed_mps, np.stack([turns.get(name, still) for name in names], axis=-1), pose.rise_m)


def figure_solids(figure: Figure, pose: Pose) -> list[Solid]:
    """Solids of the dressed body in a pose."""
    solids = [*_trunk(figure, pose), *_head(figure, pose)]
    for side in _SIDES:
        solids += [*_leg(figure, pose, side), *_arm(figure, pose, side)]
    return solids


def _trunk(figure: Figure, pose: Pose) -> list[Solid]:
    """Hips, upper garment and neck."""
    body, h, girth = load_body(), figure.height, figure.girth
    flare = 0.25 * figure.hem + 0.4 * max(figure.hem - 0.06, 0.0)  # a coat flares to leave room for steps
    hem = [(-figure.hem, -0.003, 0.074 + flare, 0.104 + 0.15 * figure.hem), (0.0, -0.003, 0.074, 0.104)]
    waist = [(z, x + figure.belly, depth + figure.belly, width) for z, x, depth, width in body.waist]
    chest = [(z, x, depth, width * figure.shoulders / _SHOULDERS) for z, x, depth, width in body.chest]
    at, turn = _vector(pose.hip), (0.0, pose.lean_deg, 0.0)
    hips, top = _rings(body.hips, h, girth), _rings([*hem, *waist, *chest], h, girth)
    neckline = _rings([(0.296, -0.006, 0.043, 0.050), (0.322, -0.006, 0.038, 0.040)], h)
    collar = Rings(shape="rings", finish="collar", rings=neckline, at=at, turn=turn)
    head_base = pose.head - np.array([0.0, 0.0, 0.03 * h])
    return [
        Rings(shape="rings", finish=figure.bottom, rings=hips, at=at, turn=turn),
        Rings(shape="rings", finish=figure.top, rings=top, at=at, turn=turn, segments=12),
        _limb(figure, "skin", "body", (pose.neck, head_base), body.neck, rounded=False),
        *([] if figure.short_sleeves or figure.top != "clothes" else [collar]),
    ]


def _head(figure: Figure, pose: Pose) -> list[Solid]:
    """Head with face, and hair or headgear."""
    body, size = load_body(), figure.height * figure.head
    solids: list[Solid] = []
    if figure.hairstyle != "full_helmet":
        skull = _rings(body.head, size)
        solids.append(Rings(shape="rings", finish="skin", rings=skull, at=_vector(pose.head)))
        for lump in body.face:
            extent, at = _vector(size * np.array(lump.size)), _vector(pose.head + size * np.array(lump.at))
            solids.append(Box(shape="box", finish=lump.finish, size=extent, at=at))
    for lump in body.hairstyles[figure.hairstyle]:
        extent, at = _vector(size * np.array(lump.size)), _vector(pose.head + size * np.array(lump.at))
        solids.append(Ellipsoid(shape="ellipsoid", finish=lump.finish, size=extent, at=at, segments=9))
    return solids


def _leg(figure: Figure, pose: Pose, side: str) -> list[Solid]:
    """Thigh, shin and shoe."""
    body, joints = load_body(), pose.joints[side]
    pitch = float(np.degrees(pose.foot_pitch_rad))
    below = "skin" if figure.short_trousers else figure.bottom
    return [
        _limb(figure, figure.bottom, f"thigh {side}", (joints["hip"], joints["knee"]), body.thigh),
        _limb(figure, below, f"shin {side}", (joints["knee"], joints["ankle"]), body.shin, rounded=False),
        Rings(
            shape="rings",
            finish=figure.shoes,
            part=f"foot {side}",
            rings=_rings(body.shoe, figure.height, _shoe_girth(figure)),
            segments=8,
            at=_vector(joints["ankle"]),
            turn=(0.0, pitch, 0.0),
        ),
    ]


def _shoe_girth(figure: Figure) -> float:
    """Girth of the shoes, which vary less than bodies."""
    return 0.5 + 0.5 * figure.girth


def _arm(figure: Figure, pose: Pose, side: str) -> list[Solid]:
    """Upper arm, forearm and hand."""
    body, joints = load_body(), pose.joints[side]
    sleeve = "skin" if figure.short_sleeves else figure.top
    fore = joints["wrist"] - joints["elbow"]
    hand = joints["wrist"] + fore / np.linalg.norm(fore) * 0.035 * figure.height
    pitch = float(np.degrees(np.arctan2(-fore[0], -fore[2])))
    ahead = np.array([np.cos(np.radians(pitch)), 0.0, -np.sin(np.radians(pitch))])
    thumb = hand + 0.017 * figure.height * ahead
    palm, bare = f"forearm {side}", "black" if figure.gloves else "skin"
    return [
        _limb(figure, figure.top, f"upper arm {side}", (joints["shoulder"], joints["elbow"]), body.upper_arm),
        _limb(figure, sleeve, f"forearm {side}", (joints["elbow"], joints["wrist"]), body.forearm),
        _lump(bare, palm, figure.height * np.array(body.hand), hand, pitch),
        _lump(bare, palm, figure.height * np.array(body.thumb), thumb, pitch + 10.0),
    ]


def _lump(finish: str, part: str, size_m: Float64Array, at_m: Float64Array, pitch_deg: float) -> Ellipsoid:
    """A small ellipsoid, turned about y."""
    size, at, turn = _vector(size_m), _vector(at_m), (0.0, pitch_deg, 0.0)
    return Ellipsoid(shape="ellipsoid", finish=finish, part=part, size=size, at=at, turn=turn, segments=7, rings=4)


def _limb(
    figure: Figure,
    finish: str,
    part: str,
    joints: tuple[Float64Array, Float64Array],
    radii: tuple[float, ...],
    rounded: bool = True,
) -> Tube:
    """A limb from joint to joint with radii at equal spacing; rounded ends extend past the joints."""
    start, end = joints
    share = np.linspace(0.0, 1.0, len(radii))
    radius = np.array(radii) * figure.height * figure.girth
    if rounded:
        first, last = radius[[0, -1]] / np.linalg.norm(end - start)
        share = np.concatenate([[-0.8 * first, -0.5 * first], share, [1.0 + 0.5 * last, 1.0 + 0.8 * last]])
        radius = np.concatenate([_ROUND * radius[0], radius, _ROUND[::-1] * radius[-1]])
    points = np.column_stack([start + share[:, None] * (end - start), radius])
    return Tube(shape="tube", finish=finish, part=part, path=tuple(map(tuple, points.tolist())), segments=8)


def _rings(
    rows: Iterable[Ring], height: float, girth: float = 1.0
) -> tuple[tuple[float, float, float, float, float], ...]:
    """Rings in meters from rows of proportions."""
    return tuple(
        (x * height, 0.0, z * height, depth * height * girth, width * height * girth) for z, x, depth, width in rows
    )


def _vector(values: Float64Array) -> Vector:
    """Three floats."""
    x, y, z = values.tolist()
    return x, y, z
