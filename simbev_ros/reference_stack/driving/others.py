"""Other road users and obstacles: where they will be, and what part of a line they occupy."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.reference_stack.arrays import Booleans, Floats
from simbev_ros.reference_stack.driving.route_line import RouteLine


@dataclass(frozen=True, eq=False)
class Others:
    """N other road users and obstacles, map frame.

    Attributes:
        position_m: (N, 2) centers.
        yaw_rad: (N,) headings.
        velocity_mps: (N, 2) velocities.
        turn_radps: (N,) yaw rates.
        braking_mps2: (N,) decelerations, 0 or more.
        size_m: (N, 2) lengths and widths.
    """

    position_m: Floats
    yaw_rad: Floats
    velocity_mps: Floats
    turn_radps: Floats
    braking_mps2: Floats
    size_m: Floats

    def chosen(self, rows: Booleans) -> "Others":
        """Some of them."""
        return Others(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def predicted(self, time_s: Floats) -> tuple[Floats, Floats]:
        """(N, T, 2) centers and (N, T) headings at (T,) times from now."""
        speed_mps = np.linalg.norm(self.velocity_mps, axis=1)[:, None]
        stop_s = speed_mps / np.maximum(self.braking_mps2[:, None], 1e-6)
        moved_s = np.minimum(time_s, stop_s)
        way_m = speed_mps * moved_s - self.braking_mps2[:, None] * moved_s**2 / 2.0
        turned_rad = self.turn_radps[:, None] * moved_s
        course_rad = np.arctan2(self.velocity_mps[:, 1], self.velocity_mps[:, 0])[:, None] + turned_rad / 2.0
        step_m = np.stack([way_m * np.cos(course_rad), way_m * np.sin(course_rad)], axis=2)
        return self.position_m[:, None] + step_m, self.yaw_rad[:, None] + turned_rad


class Occupied(NamedTuple):
    """The parts of a line beside which N others are at T times.

    Attributes:
        begin_m: (N, T) distances along the line of their rear ends.
        end_m: (N, T) distances of their front ends.
        on_path: (N, T) whether they are in the path of a vehicle on the line.
        along_mps: (N,) their present speeds along the line.
        left_m: (N, T) distances to the left of the line of their near sides; 0: they are on it.
    """

    begin_m: Floats
    end_m: Floats
    on_path: Booleans
    along_mps: Floats
    left_m: Floats

    @classmethod
    def by(
        cls, others: Others, line: RouteLine, window_m: tuple[float, float], time_s: Floats, path_m: float
    ) -> "Occupied":
        """Predict what others occupy of a path with a width, between two distances along it, at (T,) times from now."""
        position_m, yaw_rad = others.predicted(time_s)
        shape = yaw_rad.shape
        along_m, left_m = (each.reshape(shape) for each in line.project(position_m.reshape(-1, 2), *window_m))
        heading = line.headings_at(along_m.ravel()).reshape(*shape, 2)
        cosine = np.abs(np.cos(yaw_rad) * heading[..., 0] + np.sin(yaw_rad) * heading[..., 1])
        sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        length_m, width_m = (others.size_m[:, axis, None] / 2.0 for axis in (0, 1))
        half_along_m, half_across_m = cosine * length_m + sine * width_m, sine * length_m + cosine * width_m
        on_path = np.abs(left_m) < half_across_m + path_m / 2.0
        along_mps = np.einsum("ni,ni->n", others.velocity_mps, heading[:, 0])
        near_m = np.sign(left_m) * np.maximum(np.abs(left_m) - half_across_m, 0.0)
        return cls(along_m - half_along_m, along_m + half_along_m, on_path, along_mps, near_m)
