"""Markers that are filled in by columns are what rosbags serializes of message objects."""

import numpy as np
import pytest

from simbev_ros.drawing.displays.markers import CUBE, SPHERE, lines, replacing_markers
from simbev_ros.drawing.displays.messages import MARKERS, build, color, points, pose, serialize, stamped, vector
from simbev_ros.drawing.displays.serialized_markers import Lines, Solids
from simbev_ros.recording.canonical import canonical_cdr

MARKER = "visualization_msgs/msg/Marker"
NAMES = ["", "a", "ab", "abc", "abcd", "bicycle", "Straße", "traffic_light"]
"""Lengths of all alignments."""


@pytest.mark.parametrize("frame", ["map", "", "ego", "ego/base"])
def test_solids_and_lines_are_the_bytes_of_message_objects(frame: str) -> None:
    random = np.random.default_rng(3)
    names = [*NAMES, *random.permutation(NAMES).tolist()]
    header, count = stamped(1_700_000_000_123_456_789, frame), len(names)
    identities = random.integers(-(1 << 31), 1 << 31, count)
    positions_m, xyzw, sizes_m = (
        random.normal(size=(count, 3)),
        random.normal(size=(count, 4)),
        random.random((count, 3)),
    )
    rgba = random.random((count, 4))
    ends_m = random.normal(size=(5, 3))
    parts = [
        Solids(CUBE, names, identities, positions_m, xyzw, sizes_m, rgba),
        *lines(header, "heading", ends_m, 2.0 * ends_m, color((1, 2, 3)), 0.1),
        Solids(SPHERE, names[:3], identities[:3], positions_m[:3], xyzw[:3], sizes_m[:3], rgba[:3]),
    ]

    def solid(kind: int, row: int) -> object:
        red, green, blue, alpha = rgba[row].tolist()
        return build(
            MARKER,
            header=header,
            ns=names[row],
            id=int(identities[row]),
            type=kind,
            pose=pose(positions_m[row].tolist(), xyzw[row].tolist()),
            scale=vector(*sizes_m[row].tolist()),
            color=build("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=alpha),
        )

    (drawn,) = (part for part in parts if isinstance(part, Lines))
    drawn.marker.points = points(np.stack([ends_m, 2.0 * ends_m], axis=1).reshape(-1, 3))
    expected = [
        build(MARKER, header=header, action=3),
        *(solid(CUBE, row) for row in range(count)),
        drawn.marker,
        *(solid(SPHERE, row) for row in range(3)),
    ]
    wanted = serialize(build(MARKERS, markers=expected))

    assert replacing_markers(header, parts) == wanted
    assert canonical_cdr(wanted, MARKERS) == wanted


def test_without_solids_and_lines_only_the_deletion_remains() -> None:
    header = stamped(0, "map")
    none = Solids(CUBE, [], np.zeros(0, np.int64), *(np.zeros((0, n)) for n in (3, 4, 3, 4)))

    assert replacing_markers(header, [none]) == serialize(
        build(MARKERS, markers=[build(MARKER, header=header, action=3)])
    )
