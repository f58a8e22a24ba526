"""Kinds of data that displays draw, and the table of what draws each of them for one backend."""

from enum import StrEnum


class Kind(StrEnum):
    """Kind of recorded data. Its value is its key in a dataset's frame, with ``{sensor}`` for the sensor's name."""

    ACTORS = "world/actors"
    SIGNALS = "world/signals"
    LIGHTS = "world/lights"
    WEATHER = "world/weather"
    EVENTS = "world/events"
    ODOMETRY = "odom"
    BOXES = "boxes"
    GRID = "bev/labels"
    LANE = "hd_map"
    VECTOR_MAP = "vector_map"
    VOXELS = "occupancy/points"
    V2X_SENT = "v2x/{agent}"
    V2X_ARRIVED = "v2x"
    VIEWS = "{sensor}/boxes"
    RGB = "{sensor}/rgb"
    SEMANTIC = "{sensor}/semantic"
    INSTANCE = "{sensor}/instance"
    DEPTH = "{sensor}/depth"
    FLOW = "{sensor}/flow"

    @property
    def is_of_sensor(self) -> bool:
        """Whether each sensor has such data of its own."""
        return "{sensor}" in self

    def key(self, agent: str, sensor: str = "") -> str:
        """Key of the data of an agent, or of one of its sensors."""
        return self.format(agent=agent, sensor=sensor)
