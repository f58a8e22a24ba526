"""Human figures: their appearance as data, and the rigid parts of the body in a pose."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from simbev_ros.assets.actors.actor_model import Cycle, Part
from simbev_ros.assets.actors.body import load_body
from simbev_ros.assets.actors.pose import LIMBS, Pose, Seat, seated_pose, standing_pose
from simbev_ros.assets.actors.sitting import Sitting, sitting_pose
from simbev_ros.assets.actors.solids import AnySolid, Vector
from simbev_ros.config.base import Model
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.gait import Gait, interpolate_gaits


class Carried(Model):
    """Something that a figure carries.

    Attributes:
        at: Origin of the solids: a hand, the back, a hip, or the ground below the figure, which does not sway.
        solids: Solids, with lengths relative to the figure's height.
    """

    at: Literal["left hand", "right hand", "back", "left hip", "right hip", "ground"]
    solids: tuple[AnySolid, ...]


class Figure(Model):
    """Appearance and posture of a human figure.

    Attributes:
        height: Standing height, meters; the model is scaled to the blueprint's size in the end.
        girth: Thickness of trunk and limbs over that of a slim adult.
        shoulders: Half the shoulder distance over the height.
        hips: Width of the hips over the usual one.
        head: Relative size of the head over an adult's.
        belly: Forward extent of the waist over the height.
        bust: Forward extent of the chest over the height.
        hairstyle: Hairstyle or headgear, a key in body.yaml.
        beard: Beard, a key in body.yaml.
        glasses: Glasses, a key in body.yaml.
        top: Finish of the upper garment.
        bands: Finishes of the upper garment from the hem up, in turn, instead of ``top``.
        hem: Length of the upper garment below the hip joints, over the height.
        sleeves: Length of its sleeves.
        collar: Its collar; a hood hangs behind the neck.
        inner: Finish of what shows where the upper garment is open; none: it is closed.
        opening: Half widths of the opening at the waist and at the neck, over the height.
        tie: Finish of a tie; none: there is no tie.
        vest: Finish of a vest over the upper garment; none: there is no vest.
        belt: Finish of a belt; none: there is no belt.
        bottom: Finish of the trousers or the skirt.
        trousers: Length of the trousers.
        baggy: Thickness of the trousers over that of slim ones.
        skirt: Length of a skirt below the hip joints, over the height; 0: there is none.
        flare: Width of the hem of a skirt or coat over the usual one.
        stockings: Finish of legs below a skirt or shorts.
        shoes: Finish of the shoes.
        soles: Finish of their soles.
        boots: Whether the shoes are boots.
        gloves: Whether the hands have black gloves.
        seat: Sitting posture of a rider; None for a figure on foot.
        sitting: Posture of a person on a bench or chair; None for all others. Both arms are held.
        stoop_deg: Additional forward lean of the trunk on foot.
        elbow_deg: Minimum bend of the elbows on foot.
        arm_swing: Swing of the arms on foot, relative to the usual one.
        rest_deg: Bend of the left and the right elbow when the figure stands, of arms that swing on foot.
        left_arm: How the left arm is held on foot, a key in body.yaml; none: it swings.
        right_arm: How the right arm is held.
        limps: Whether the left leg hurts.
        stick: Tip of a stick that the right hand sets down with that leg, from the hand and over the height.
        carried: What the figure carries.
    """

    height: float
    girth: float = 1.0
    shoulders: float
    hips: float = 1.0
    head: float = 1.0
    belly: float = 0.0
    bust: float = 0.0
    hairstyle: str
    beard: str = "none"
    glasses: str = "none"
    top: str = "clothes"
    bands: tuple[str, ...] = ()
    hem: float = 0.01
    sleeves: Literal["long", "half", "none"] = "long"
    collar: Literal["none", "round", "high", "hood"] = "none"
    inner: str = ""
    opening: tuple[float, float] = (0.004, 0.036)
    tie: str = ""
    vest: str = ""
    belt: str = ""
    bottom: str = "second"
    trousers: Literal["long", "half", "none"] = "long"
    baggy: float = 1.0
    skirt: float = 0.0
    flare: float = 1.0
    stockings: str = "skin"
    shoes: str = "shoes"
    soles: str = "trim"
    boots: bool = False
    gloves: bool = False
    seat: Seat | None = None
    sitting: Sitting | None = None
    stoop_deg: float = 0.0
    elbow_deg: float = 0.0
    arm_swing: float = 1.0
    rest_deg: tuple[float, float] = (8.0, 8.0)
    left_arm: str = ""
    right_arm: str = ""
    limps: bool = False
    stick: tuple[float, float, float] | None = None
    carried: tuple[Carried, ...] = ()


SIDES = ("left", "right")
_ROW_PARTS = 6


def figure_pose(figure: Figure, tall_m: float) -> Pose:
    """Pose in which a figure is modeled; ``tall_m`` is its height including hair."""
    if figure.seat:
        return seated_pose(figure.seat, figure.height, figure.shoulders)
    body = load_body()
    x, half = body.shoe[0][1:3]
    half *= shoe_girth(figure)
    sole = (x - half, x + half)
    held = {
        side: body.arms[name] for side, name in zip(SIDES, (figure.left_arm, figure.right_arm), strict=True) if name
    }
    if figure.sitting:
        return sitting_pose(figure.sitting, figure.height, figure.girth, figure.shoulders, sole, held)
    gaits = [_own_gait(figure, gait) for gait in interpolate_gaits(_ROW_PARTS)]
    limp = figure.limps, figure.stick
    pose = standing_pose(gaits, figure.height, tall_m, figure.shoulders, sole, held, *limp)
    for side, bend_deg in zip(SIDES, figure.rest_deg, strict=True):
        if side not in held:
            pose.turn_rad[side]["forearm"][0] = -np.radians(bend_deg)
    return pose


def shoe_girth(figure: Figure) -> float:
    """Girth of the shoes, which vary less than bodies."""
    return 0.5 + 0.5 * figure.girth


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


def figure_parts(figure: Figure, pose: Pose, first: int) -> list[Part]:
    """Rigid parts of both sides: thigh, shin, foot, upper arm and forearm; ``first`` is the index of the first one.

    The last one, ``ground``, has no parent: what is on it neither leans nor rises with the trunk.
    """
    parts: list[Part] = []
    for side in SIDES:
        joints, thigh = pose.joints[side], first + len(parts)
        parts += [
            Part(f"thigh {side}", 0, vector(joints["hip"])),
            Part(f"shin {side}", thigh, vector(joints["knee"])),
            Part(f"foot {side}", thigh + 1, vector(joints["ankle"])),
            Part(f"upper arm {side}", 0, vector(joints["shoulder"])),
            Part(f"forearm {side}", thigh + 3, vector(joints["elbow"])),
        ]
    return parts + [Part("ground")] * any(each.at == "ground" for each in figure.carried)


def body_part(pose: Pose) -> Part:
    """Rigid part of the trunk, which leans about the hips."""
    return Part("body", pivot_m=vector(pose.hip))


def figure_cycle(pose: Pose, names: Sequence[str]) -> Cycle:
    """Motion cycle of the parts with these names; only the body and limbs turn."""
    turns = {"body": pose.trunk_rad}
    turns |= {f"{limb} {side}": pose.turn_rad[side][limb] for side in SIDES for limb in LIMBS}
    still = np.zeros_like(pose.trunk_rad)
    turn_rad = np.stack([turns.get(name, still) for name in names], axis=-1)
    return Cycle(pose.speed_mps, turn_rad.astype(np.float32), pose.rise_m.astype(np.float32))


def vector(values: Float64Array) -> Vector:
    """Three floats."""
    x, y, z = values.tolist()
    return x, y, z
