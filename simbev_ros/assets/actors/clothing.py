"""Solids of a dressed human figure in a pose: trunk, head, legs and arms, their clothes, and what is carried."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from simbev_ros.assets.actors.body import Ring, load_body
from simbev_ros.assets.actors.figure import SIDES, Figure, shoe_girth, vector
from simbev_ros.assets.actors.limbs import HAND
from simbev_ros.assets.actors.pose import Pose
from simbev_ros.assets.actors.solids import AnySolid, Box, Rings, Solid, Tube
from simbev_ros.foundation.types import Float64Array

_ROUND = np.array([0.45, 0.83])
"""Radii toward the rounded end of a limb, over the limb's own radius."""
_SHOULDERS = 0.112
"""Value of ``Figure.shoulders`` that the chest in body.yaml is made for."""
_COAT = 0.10
"""Length of a hem over the height from which an upper garment follows the thighs, as a skirt does."""
_TUCKED = 0.06
_ON_SEAT, _HIPS_DEPTH = -0.042, 0.06
"""Lower end of the hips of a person who sits, above the hip joints, and half their depth, over the height."""
_BUST, _NECK = (0.205, 0.240), 0.296


def figure_solids(figure: Figure, pose: Pose) -> list[Solid]:
    """Solids of the dressed body in a pose."""
    solids = [*_trunk(figure, pose), *_head(figure, pose), *_carried(figure, pose)]
    for side in SIDES:
        solids += [*_leg(figure, pose, side), *_arm(figure, pose, side)]
    return solids


def _trunk(figure: Figure, pose: Pose) -> list[Solid]:
    """Hips, upper garment with all that belongs to it, and neck."""
    body, h, girth = load_body(), figure.height, figure.girth
    at, turn = vector(pose.hip), (0.0, pose.lean_deg, 0.0)

    def layer(finish: str, rows: Iterable[Ring], thick: float = girth, segments: int = 12) -> Rings:
        rings = _rings(rows, h, thick)
        return Rings(shape="rings", finish=finish, rings=rings, at=at, turn=turn, segments=segments)

    hips = [(z, x, depth, width * figure.hips) for z, x, depth, width in body.hips]
    if figure.sitting:  # on the thighs, not in the seat, however the trunk leans
        lean = abs(np.radians(pose.lean_deg))
        hips = _between(hips, float((_ON_SEAT + _HIPS_DEPTH * np.sin(lean)) / np.cos(lean)), hips[-1][0])
    torso = _torso(figure)
    solids: list[Solid] = [layer(figure.bottom, hips, segments=10)]
    bands = figure.bands or (figure.top,)
    if figure.bands:
        solids += [
            layer(bands[k % len(bands)], _between(torso, low, high)) for k, (low, high) in enumerate(_heights(torso))
        ]
    else:
        solids.append(layer(figure.top, torso))
    solids += [layer(finish, rows) for finish, rows in _fronts(figure, torso)]
    if figure.collar in ("round", "high"):
        top = 0.312 if figure.collar == "round" else 0.336
        neckline = [(0.290, -0.008, 0.046, 0.054), (top, -0.006, 0.039, 0.042)]
        solids.append(layer("collar" if figure.top == "clothes" else figure.top, neckline, 1.0))
    if figure.collar == "hood":
        hood = [(0.235, -0.066, 0.018, 0.040), (0.262, -0.062, 0.030, 0.060), (0.302, -0.044, 0.030, 0.056)]
        solids.append(layer(figure.top, [*hood, (0.316, -0.036, 0.020, 0.044)], 1.0))
    if figure.vest:
        solids += [
            layer(figure.vest, [(z, x, d + 0.007, w + 0.007) for z, x, d, w in _between(torso, 0.03, 0.282)]),
            *(layer("plate", [(z, 0.0, 0.075, 0.106) for z in (low, low + 0.018)]) for low in (0.075, 0.135)),
        ]
    if figure.belt:
        solids.append(layer(figure.belt, [(z, 0.001, 0.064, 0.092 * figure.hips) for z in (0.042, 0.062)]))
    neck = (pose.neck, pose.head - np.array([0.0, 0.0, 0.03 * h]))
    return [*solids, _limb(figure, "skin", "body", neck, body.neck, rounded=False)]


def _torso(figure: Figure) -> list[Ring]:
    """Rings of the upper garment from the hem to the neck."""
    body, hem = load_body(), figure.hem if figure.hem < _COAT else 0.02
    flare = 0.25 * hem + 0.3 * max(hem - _TUCKED, 0.0)
    below = [
        (-hem, -0.003, 0.074 + flare, (0.100 + 0.15 * hem) * figure.hips),
        (0.0, -0.003, 0.072, 0.099 * figure.hips),
    ]
    waist = [(z, x + figure.belly, depth + figure.belly, width) for z, x, depth, width in body.waist]
    chest = []
    for z, x, depth, width in body.chest:
        bust = figure.bust / 2.0 if z in _BUST else 0.0
        chest.append((z, x + bust, depth + bust, width * figure.shoulders / _SHOULDERS))
    return [*below, *waist, *chest]


def _between(rows: Sequence[Ring], low: float, high: float) -> list[Ring]:
    """The part of a body of rings between two heights."""
    heights = np.array([row[0] for row in rows])
    at = [low, *(z for z in heights.tolist() if low < z < high), high]
    columns = [np.interp(at, heights, [row[k] for row in rows]).tolist() for k in (1, 2, 3)]
    return list(zip(at, *columns, strict=True))


def _heights(torso: Sequence[Ring]) -> list[tuple[float, float]]:
    """Lower and upper ends of the bands of a striped garment."""
    ends = np.linspace(torso[0][0], torso[-1][0], 10).tolist()
    return list(pairwise(ends))


def _fronts(figure: Figure, torso: Sequence[Ring]) -> list[tuple[str, list[Ring]]]:
    """Strips on the front of the chest: lapels, what is worn inside, and a tie, each before the one behind it."""
    strips: list[tuple[str, tuple[float, float], float]] = []
    if figure.inner:
        low, high = figure.opening
        lapels = "collar" if figure.top == "clothes" else "second_dark"
        strips += [(lapels, (low + 0.016, high + 0.014), 0.002), (figure.inner, (low, high), 0.004)]
    if figure.tie:
        strips.append((figure.tie, (0.006, 0.009), 0.007))
    start = 0.15 if figure.opening[0] < 0.02 else torso[0][0]
    rows = _between(torso, start, _NECK)
    share = np.linspace(0.0, 1.0, len(rows))
    return [
        (
            finish,
            [
                (z, x + depth - 0.010 + out, 0.010, float(np.interp(along, [0.0, 1.0], widths)))
                for (z, x, depth, _), along in zip(rows, share, strict=True)
            ],
        )
        for finish, widths, out in strips
    ]


def _head(figure: Figure, pose: Pose) -> list[Solid]:
    """Head with face, and hair or headgear."""
    body, size = load_body(), figure.height * figure.head
    lumps: list[AnySolid] = []
    solids: list[Solid] = []
    if figure.hairstyle != "full_helmet":
        skull = _rings(body.head, size)
        solids.append(Rings(shape="rings", finish="skin", rings=skull, at=vector(pose.head), segments=11))
        lumps += [*body.face, *body.beards[figure.beard], *body.glasses[figure.glasses]]
    lumps += body.hairstyles[figure.hairstyle]
    return solids + [lump.placed(size, pose.head, "body") for lump in lumps]


def _leg(figure: Figure, pose: Pose, side: str) -> list[Solid]:
    """Thigh, shin and shoe, with the skirt or coat that follows the thigh."""
    body, joints = load_body(), pose.joints[side]
    below = figure.bottom if figure.trousers == "long" else figure.stockings
    above = figure.bottom if figure.trousers != "none" else figure.stockings
    loose = figure.baggy if figure.trousers == "long" else 1.0
    ankle = joints["ankle"] + (joints["knee"] - joints["ankle"]) * (0.04 if below == figure.bottom else -0.04)
    shin = [
        radius * (1.0 + (loose - 1.0) * 1.5 * share)
        for radius, share in zip(body.shin, (0.4, 0.7, 1.0, 1.2), strict=True)
    ]
    solids: list[Solid] = [
        _limb(figure, below, f"shin {side}", (joints["knee"], ankle), shin, rounded=False),
        *_shoe(figure, pose, side),
    ]
    thigh = [
        radius * (1.0 + (figure.baggy - 1.0) * share)
        for radius, share in zip(body.thigh, (0.0, 0.4, 0.7, 0.8), strict=True)
    ]
    if figure.skirt < 0.2:
        solids.append(_limb(figure, above, f"thigh {side}", (joints["hip"], joints["knee"]), thigh))
    if figure.boots:
        top = joints["ankle"] + 0.55 * (joints["knee"] - joints["ankle"])
        solids.append(
            _limb(figure, figure.shoes, f"shin {side}", (top, joints["ankle"]), (0.037, 0.033, 0.031), rounded=False)
        )
    for finish, length in ((figure.bottom if figure.skirt else "", figure.skirt), (figure.top, figure.hem - 0.01)):
        if finish and (length > _COAT or figure.skirt == length):
            solids += _flap(figure, finish, pose, side, length)
    return solids


def _flap(figure: Figure, finish: str, pose: Pose, side: str, length: float) -> list[Solid]:
    """Half of a skirt or of a coat's lower part, which moves with a thigh, and its middle, which does not."""
    h, joints = figure.height, pose.joints[side]
    along = (joints["knee"] - joints["hip"]) / np.linalg.norm(joints["knee"] - joints["hip"])
    wide = figure.flare * np.array([0.056, 0.060, 0.058 + 0.06 * length])
    start, end = joints["hip"] + 0.01 * h * along, joints["hip"] + length * h * along
    solids: list[Solid] = [_limb(figure, finish, f"thigh {side}", (start, end), wide.tolist(), rounded=False)]
    if side == "left":
        spread = 0.9 * length * figure.flare
        hem = (-0.93 * length, -0.003, 0.066 + 0.08 * spread, (0.104 + 0.09 * spread) * figure.hips)
        rings = _rings([hem, (0.0, -0.003, 0.074, 0.103 * figure.hips), (0.056, 0.0, 0.064, 0.091)], h, figure.girth)
        solids.append(
            Rings(shape="rings", finish=finish, rings=rings, at=vector(pose.hip), turn=(0.0, pose.lean_deg, 0.0))
        )
    return solids


def _shoe(figure: Figure, pose: Pose, side: str) -> list[Solid]:
    """Shoe and its sole."""
    rows, size = load_body().shoe, (figure.height, shoe_girth(figure))
    at, turn = vector(pose.joints[side]["ankle"]), (0.0, float(np.degrees(pose.foot_pitch_rad)), 0.0)
    sole = [
        (z, x, depth + 0.001, width + 0.001) for (z, x, depth, width) in (rows[0], (rows[0][0] + 0.007, *rows[0][1:]))
    ]
    pieces = ((figure.shoes, rows), (figure.soles, sole))
    return [
        Rings(shape="rings", finish=finish, part=f"foot {side}", rings=_rings(of, *size), segments=8, at=at, turn=turn)
        for finish, of in pieces
    ]


def _arm(figure: Figure, pose: Pose, side: str) -> list[Solid]:
    """Upper arm, forearm and hand."""
    body, joints = load_body(), pose.joints[side]
    upper, fore = f"upper arm {side}", f"forearm {side}"
    above = "skin" if figure.sleeves == "none" else figure.bands[0] if figure.bands else figure.top
    below = above if figure.sleeves == "long" else "skin"
    bone = joints["elbow"] - joints["shoulder"]
    cuff = joints["wrist"] + (joints["elbow"] - joints["wrist"]) * (0.06 if below == above else 0.0)
    sleeve = [radius + (0.003 if figure.sleeves == "long" else 0.0) for radius in body.forearm]
    solids: list[Solid] = [
        _limb(
            figure,
            above if figure.sleeves != "half" else "skin",
            upper,
            (joints["shoulder"], joints["elbow"]),
            body.upper_arm,
        ),
        _limb(figure, below, fore, (joints["elbow"], cuff), sleeve, rounded=below == "skin"),
        *_hand(figure, joints, fore),
    ]
    if below != "skin":
        solids.append(
            _limb(
                figure,
                "black" if figure.gloves else "skin",
                fore,
                (cuff, joints["wrist"] + 0.1 * (cuff - joints["elbow"])),
                (0.017, 0.016),
                rounded=False,
            )
        )
    if figure.sleeves == "half":
        end = joints["shoulder"] + 0.62 * bone
        solids.append(_limb(figure, above, upper, (joints["shoulder"], end), (0.034, 0.034, 0.035)))
    return solids


def _hand(figure: Figure, joints: Mapping[str, Float64Array], part: str) -> list[Solid]:
    """Palm, fingers and thumb along the forearm."""
    body, h, finish = load_body(), figure.height, "black" if figure.gloves else "skin"
    along = joints["wrist"] - joints["elbow"]
    along /= np.linalg.norm(along)
    turn = (float(np.degrees(np.arcsin(along[1]))), float(np.degrees(np.arctan2(-along[0], -along[2]))), 0.0)
    ahead = np.cross(along, [0.0, 1.0, 0.0])
    ahead /= -np.linalg.norm(ahead)
    pieces = ((body.palm, 0.022 * along), (body.fingers, 0.066 * along), (body.thumb, 0.040 * along + 0.024 * ahead))
    return [
        Box(
            shape="box",
            finish=finish,
            part=part,
            size=vector(h * np.array(size)),
            at=vector(joints["wrist"] + h * off),
            turn=turn,
            bevel=0.005 * h * (size == body.palm),
        )
        for size, off in pieces
    ]


def hand_m(figure: Figure, pose: Pose, side: str) -> Float64Array:
    """(3,) middle of a hand."""
    joints = pose.joints[side]
    along = joints["wrist"] - joints["elbow"]
    middle: Float64Array = joints["wrist"] + along / np.linalg.norm(along) * HAND * figure.height
    return middle


def _carried(figure: Figure, pose: Pose) -> list[Solid]:
    """What the figure carries."""
    h, hip = figure.height, pose.hip
    wide = 0.100 * figure.girth * figure.hips
    places = {
        "back": (hip + h * np.array([-0.066 * figure.girth, 0.0, 0.20]), "body"),
        "left hip": (hip + h * np.array([0.0, wide, 0.0]), "body"),
        "right hip": (hip - h * np.array([0.0, wide, 0.0]), "body"),
        "ground": (np.zeros(3), "ground"),
        **{f"{side} hand": (hand_m(figure, pose, side), f"forearm {side}") for side in SIDES},
    }
    return [solid.placed(h, *places[each.at]) for each in figure.carried for solid in each.solids]


def _limb(
    figure: Figure,
    finish: str,
    part: str,
    joints: tuple[Float64Array, Float64Array],
    radii: Sequence[float],
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
