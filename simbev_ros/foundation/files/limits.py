"""Limits of foreign input: how much a file may unpack to, contain or nest, checked before memory or time is spent.

Files from elsewhere can be small and still demand gigabytes: compressed zeros, aliases in YAML, declared sizes and
counts. Every reader of such a file compares what the file declares with these limits first, and stops unpacking at
them. They are well above what this project writes; ``SIMBEV_MAX_UNPACKED_MIB`` raises the one that large predictions
may reach.
"""

import os

from simbev_ros.foundation.errors import InputError, LimitError

MAX_UNPACKED_VARIABLE = "SIMBEV_MAX_UNPACKED_MIB"
"""Environment variable that replaces the default of ``max_unpacked_bytes``, in MiB."""

DEFAULT_MAX_UNPACKED_BYTES = 1 << 30
"""Size after decompression of an MCAP chunk, of all arrays of an NPZ file, of the index of a dataset, and of one row
group or one scene in a Parquet file of predictions. The largest message that a configuration allows, an optical flow
image of 8192 x 8192 pixels, has 512 MiB; chunks without such a message have at most 32 MiB. `SIMBEV_MAX_UNPACKED_MIB`
sets another limit."""

MAX_CHUNK_RECORDS = 1 << 20
"""Records in an MCAP chunk or in the summary of an MCAP file. A chunk of 32 MiB with nothing but /clock has 780,000."""

MAX_MAP_BYTES = 128 << 20
"""Size of an OpenDRIVE file, a Lanelet2 map or a SUMO net, on disk and unpacked."""

MAX_OSM_BYTES = 512 << 20
"""Size of an OpenStreetMap file in XML, on disk and unpacked. Use PBF for a larger area."""

MAX_MAP_RATIO = 100
"""Factor by which a compressed map file may grow beyond the first 16 MiB; about 20 is usual."""

MAX_PBF_BYTES = 16 << 30
"""Size of an OpenStreetMap file in PBF; whole countries are smaller."""

MAX_PBF_RATIO = 32
"""Factor by which the content of an OpenStreetMap file in PBF may grow when it is unpacked; about 2 is usual."""

MAX_OSM_NODES = 5_000_000
"""Nodes of an OpenStreetMap file, or of its part within `bounds`, and a quarter of the references to them. The densest
cities have about 15,000 a square kilometer."""

MAX_OSM_ELEMENTS = 20_000_000
"""Elements of an OpenStreetMap file in XML, tags and references to nodes included. They are not kept as a tree."""

MAX_XML_DEPTH = 64
"""Nesting of elements in a map file. OpenDRIVE nests about 10 deep."""

MAX_XML_ELEMENTS = 2_500_000
"""Elements in an OpenDRIVE file, a Lanelet2 map or a SUMO net; a file of 128 MiB with short elements can reach it."""

MAX_SCENARIO_BYTES = 16 << 20
"""Size of a file in OpenSCENARIO XML. A trajectory of an hour with 10 points a second takes 5 MiB."""

MAX_SCENARIO_ELEMENTS = 300_000
"""Elements of a file in OpenSCENARIO XML, and of a scenario with its catalogs. A point of a trajectory has three."""

MAX_LANELETS = 50_000
"""Lanelets in a Lanelet2 map."""

MAX_LANELET_POINTS = 2_000_000
"""Points in the bounds of all lanelets of a Lanelet2 map, each bound counted once per lanelet."""

MAX_BOUND_POINTS = 10_000
"""Points in a bound of a lanelet; a lanelet with more is left out."""

MAX_LANELET_PAIRS = 300_000
"""Pairs of lanelets that follow each other, and pairs that overlap, in a Lanelet2 map."""

MAX_OBJECT_COPIES = 10_000
"""Copies of one object that is repeated along an OpenDRIVE road."""

MAX_MAP_OBJECTS = 200_000
"""Maximum number of roadside objects of a map, such as trees and poles, including copies. The rest is left out."""

MAX_OBJECT_LINES_KM = 1_000
"""Length of all barriers, rails, tree rows and power lines of an OpenStreetMap file. Further ones are left out."""

MAX_LANES_PER_EDGE = 100
"""Lanes side by side in an edge of a SUMO net; an edge with more is left out. The widest motorway has 26 in all."""

MAX_SECTIONS_PER_M = 10.0
"""Lane sections per meter of an OpenDRIVE road, beyond the first 100; a road with more is left out."""

MAX_FINDINGS = 1_000
"""Maximum number of places in a map's file that are listed for each kind of finding; the rest is counted."""

MAX_YAML_BYTES = 4 << 20
"""Size of a YAML text: a configuration, or a bag's description. The description of a bag with 100 topics has 80 KiB."""

MAX_YAML_VALUES = 200_000
"""Values in a YAML text after its aliases are expanded. The description of a bag with 100 topics has 5,000."""

MAX_YAML_DEPTH = 64
"""Nesting of lists and mappings in a bag's description, which nests 8 deep."""

MAX_YAML_NUMBER_CHARS = 64
"""Characters of a number or date in a bag's description. Long base-60 numbers take time quadratic in their length."""

MAX_IMAGE_SIDE_PX = 8192
"""Width and height of a compressed image, and of a camera in a configuration."""

MAX_ORDERED_SAMPLES = 1 << 28
"""Pixels, rays, cells and voxels at one tick of a scene that a ROS node orders; 6 x as many as the paper has."""

MAX_ORDERED_SENSORS = 256
"""Sensors of all agents in a scene that a ROS node orders; the paper's rig has 13."""

MAX_SCENE_NUMBER = 500_000
"""Highest number of a scene. Scenes are an hour apart, and stamps are int32 seconds."""

MAX_SCENE_TICKS = 3_000_000
"""Recorded ticks of a scene: 3000 s, the longest duration of a configuration, in ticks of 1 ms, the shortest ones."""

MAX_WARM_UP_TICKS = 600_000
"""Warm-up ticks of a scene: 600 s in ticks of 1 ms."""

MAX_ACTORS = 20_000
"""Vehicles in a scene, and pedestrians in a scene. A configuration allows 10,000 of each; hazard areas add vehicles."""

MAX_AGENTS = 32
"""Agents in a scene: vehicles and roadside units with sensors. A mask of 32 bits says which of them see an object."""

MAX_ROUTE_POINTS = 50_000
"""Points of the route that an agent drives; the longest one of a configuration, 20 km, has 20,000."""

MAX_DRIVE_EVENTS = 1_000
"""Events along a route."""

MAX_LISTED_OBJECTS = 5_000_000
"""Objects in a folder of an object store; a dataset with the highest number of scenes and their logs has 2 million."""

MAX_EMPTY_PAGES = 1_000
"""Pages without an object in a store's list of a folder; of most stores, no page is empty."""

_MIB = 1 << 20


def max_unpacked_bytes() -> int:
    """``DEFAULT_MAX_UNPACKED_BYTES``, or the value of ``SIMBEV_MAX_UNPACKED_MIB`` in bytes.

    Raises:
        InputError: The variable is not a positive integer.
    """
    text = os.environ.get(MAX_UNPACKED_VARIABLE)
    if text is None:
        return DEFAULT_MAX_UNPACKED_BYTES
    if not (text.isascii() and text.isdecimal() and 0 < len(text) <= _MAX_DIGITS and int(text)):
        raise InputError(f"{MAX_UNPACKED_VARIABLE}: is {text!r}; allowed: a positive integer, in MiB")
    return int(text) * _MIB


_MAX_DIGITS = 9


def require_unpacked_size(size_bytes: int, subject: str = "it") -> None:
    """Raise LimitError if something unpacks to more than ``max_unpacked_bytes``; ``subject`` begins the message."""
    limit_bytes = max_unpacked_bytes()
    if size_bytes > limit_bytes:
        size_mib = -(-size_bytes // _MIB)
        raise LimitError(
            f"{subject} unpacks to {size_mib:,} MiB; at most {limit_bytes // _MIB:,} MiB are unpacked; "
            f"{MAX_UNPACKED_VARIABLE}={size_mib} would allow it"
        )
