"""Tables about a drive: the route, the progress along it, and the status of an agent's vehicle."""

import math
from collections.abc import Mapping

import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.schema.messages.message_rows import message_constants, row_dtype
from simbev_ros.schema.scene.drive_spec import Command, RouteSpec
from simbev_ros.schema.scene.route_progress import RouteProgress
from simbev_ros.schema.scene.state import Light

ROUTE_DTYPE = row_dtype("RoutePoint")
"""Row of /drive/plan; ``interfaces/msg/RoutePoint.msg`` says what its columns mean."""

PROGRESS_DTYPE = row_dtype("DriveProgress")
"""The row of /drive/progress; ``interfaces/msg/DriveProgress.msg`` has its columns."""

STATUS_DTYPE = row_dtype("VehicleStatus")
"""The row of /<agent>/vehicle_status; ``interfaces/msg/VehicleStatus.msg`` has its columns."""

COMMAND_NUMBERS: Mapping[Command, int] = {
    command: message_constants("RoutePoint")[f"COMMAND_{command.name}"] for command in Command
}
_STATUS = message_constants("VehicleStatus")


def route_table(route: RouteSpec) -> Table:
    """(N,) ``ROUTE_DTYPE`` rows of the points of a route."""
    table = np.zeros(len(route.x_m), ROUTE_DTYPE)
    for name, column in (("x", route.x_m), ("y", route.y_m), ("z", route.z_m)):
        table[name] = column
    table["distance"], table["speed_limit"] = route.distance_m, route.limit_mps
    table["yaw"] = route.yaw_rad
    table["command"] = [COMMAND_NUMBERS[command] for command in route.command]
    return table


class ProgressTables:
    """Makes the table of the progress along a route at each tick."""

    def __init__(self, route: RouteSpec) -> None:
        """Start at the beginning of a route."""
        self._route, self._progress = route, RouteProgress(route)

    def table_at(self, ego: Table) -> Table:
        """(1,) ``PROGRESS_DTYPE`` of the ego's ``ACTOR_DTYPE`` row, which is one tick after that of the last call."""
        progress = self._progress.advance_to(np.array([ego["x"], ego["y"]], np.float64))
        command, command_m = self._progress.next_command(progress)
        turn_rad = float(ego["yaw"]) - float(self._route.yaw_rad[progress.row])
        values = {
            "distance": progress.distance_m,
            "remaining": progress.remaining_m,
            "lateral": progress.lateral_m,
            "heading": math.remainder(turn_rad, math.tau),
            "speed_limit": self._route.limit_mps[progress.row],
            "command_distance": command_m,
            "command": COMMAND_NUMBERS[command],
        }
        return _row(values, PROGRESS_DTYPE)


def status_table(vehicle: Table) -> Table:
    """(1,) ``STATUS_DTYPE`` of a vehicle's ``ACTOR_DTYPE`` row."""
    cosine, sine = math.cos(vehicle["yaw"]), math.sin(vehicle["yaw"])
    lights = int(vehicle["lights"])
    left, right = (bool(lights & each) for each in (Light.TURN_LEFT, Light.TURN_RIGHT))
    values = {
        "speed": cosine * vehicle["vx"] + sine * vehicle["vy"],
        "acceleration": cosine * vehicle["ax"] + sine * vehicle["ay"],
        "steering": vehicle["steer"],
        "yaw_rate": vehicle["wz"],
        "gear": _STATUS["GEAR_REVERSE" if lights & Light.REVERSE else "GEAR_DRIVE"],
        "indicators": left * _STATUS["INDICATOR_LEFT"] | right * _STATUS["INDICATOR_RIGHT"],
    }
    return _row(values, STATUS_DTYPE)


def _row(values: Mapping[str, float], dtype: np.dtype[np.void]) -> Table:
    return np.array([tuple(values[name] for name in dtype.names or ())], dtype)
