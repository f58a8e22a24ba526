"""Traffic signs. Frame: origin at the foot, the sign faces x, z up."""

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color
from simbev_ros.assets.primitives import Finish, box, cylinder
from simbev_ros.semantics import Tag

_STEEL = (104, 108, 111)


def speed_sign(limit_kmh: int) -> Mesh:
    """A speed-limit sign (white, red rim, two digits) that faces x."""
    pole = Finish(Material.METAL, Tag.POLE, _STEEL)
    red, white = (Finish(Material.PLATE, Tag.TRAFFIC_SIGN, color) for color in ((196, 30, 34), (240, 240, 238)))
    black = Finish(Material.PLATE, Tag.TRAFFIC_SIGN, (20, 20, 22))
    back = Finish(Material.METAL, Tag.TRAFFIC_SIGN, _STEEL)
    tens, ones = divmod(limit_kmh, 10)
    z_m = 2.45
    return Mesh.merged(
        [
            cylinder(pole, (0.0, 0.0, 0.0), (0.0, 0.0, z_m + 0.25), 0.035, segments=6),
            cylinder(back, (0.03, 0.0, z_m), (0.045, 0.0, z_m), 0.31, segments=12),
            cylinder(red, (0.044, 0.0, z_m), (0.055, 0.0, z_m), 0.32, segments=14),
            cylinder(white, (0.05, 0.0, z_m), (0.062, 0.0, z_m), 0.255, segments=14),
            *_digit(black, tens, (0.064, -0.1, z_m)),
            *_digit(black, ones, (0.064, 0.1, z_m)),
        ]
    )


def street_name_sign(color: Color) -> Mesh:
    """Two name plates across each other on a post."""
    pole, plate_ = Finish(Material.METAL, Tag.POLE, _STEEL), Finish(Material.PLATE, Tag.TRAFFIC_SIGN, color)
    return Mesh.merged(
        [
            cylinder(pole, (0.0, 0.0, 0.0), (0.0, 0.0, 2.9), 0.035, segments=6),
            box(plate_, (0.95, 0.02, 0.2), (0.42, 0.0, 2.75)),
            box(plate_, (0.02, 0.95, 0.2), (0.0, 0.42, 2.5)),
        ]
    )


def _digit(finish: Finish, value: int, center_m: tuple[float, float, float]) -> list[Mesh]:
    """Seven-segment figure 0.28 m high, read from x; the reader's right is +y."""
    x_m, y_m, z_m = center_m
    upright, level = (0.006, 0.03, 0.14), (0.006, 0.12, 0.03)
    spots = {
        "a": (level, 0.0, 0.125),
        "b": (upright, 0.05, 0.065),
        "c": (upright, 0.05, -0.065),
        "d": (level, 0.0, -0.125),
        "e": (upright, -0.05, -0.065),
        "f": (upright, -0.05, 0.065),
        "g": (level, 0.0, 0.0),
    }
    return [
        box(finish, size, (x_m, y_m + side_m, z_m + up_m))
        for segment, (size, side_m, up_m) in spots.items()
        if segment in _SEGMENTS[value]
    ]


_SEGMENTS = ("abcdef", "bc", "abdeg", "abcdg", "bcfg", "acdfg", "acdefg", "abc", "abcdefg", "abcdfg")
