"""Who may use a lane, in SUMO's vehicle classes."""

from functools import cache

ALL_CLASSES = frozenset(
    [
        "private",
        "emergency",
        "authority",
        "army",
        "vip",
        "pedestrian",
        "passenger",
        "hov",
        "taxi",
        "bus",
        "coach",
        "delivery",
        "truck",
        "trailer",
        "motorcycle",
        "moped",
        "bicycle",
        "evehicle",
        "tram",
        "rail_urban",
        "rail",
        "rail_electric",
        "rail_fast",
        "ship",
        "container",
        "cable_car",
        "subway",
        "aircraft",
        "wheelchair",
        "scooter",
        "drone",
        "custom1",
        "custom2",
    ]
)
"""All of SUMO's."""


@cache
def open_to(allow: str, disallow: str) -> frozenset[str]:
    """Classes that a lane with these two attributes of a SUMO net is open to; the first one holds if it is given."""
    if allow:
        return ALL_CLASSES if "all" in allow.split() else ALL_CLASSES.intersection(allow.split())
    return frozenset() if "all" in disallow.split() else ALL_CLASSES.difference(disallow.split())
