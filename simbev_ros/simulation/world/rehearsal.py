"""Simulates the traffic of a scene ahead, without sensors, to judge its motion before anything is rendered."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from simbev_ros.assets.regions.region_scene import Streetside
from simbev_ros.config.acceptance import Acceptance
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.ending import SceneEndDetector
from simbev_ros.schema.scene.route_progress import STANDING_MPS
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.world.simulation import Simulation


@dataclass(frozen=True, slots=True)
class SceneMotion:
    """What moves in the recorded part of a scene.

    Attributes:
        path_m: Length of the path of the center of the ego's box.
        mean_speed_mps: Mean horizontal speed of the ego.
        standing_share: Share of the ticks in which the ego is slower than ``STANDING_MPS``.
        boxes: Mean number of other actors within the radius of the ego's labels.
        collisions: Number of collisions of the ego.
    """

    path_m: float
    mean_speed_mps: float
    standing_share: float
    boxes: float
    collisions: int

    @classmethod
    def of(cls, states: list[WorldState], spec: SceneSpec) -> Self:
        """The motion in the states of all recorded ticks."""
        radius_m = spec.agents[0].annotation.box_radius_m
        egos = [state.ego for state in states]
        speeds_mps = np.array([math.hypot(ego["vx"], ego["vy"]) for ego in egos])
        positions_m = [(float(ego["x"]), float(ego["y"]), float(ego["z"])) for ego in egos]
        is_near = [(state.distance_to_ego_m <= radius_m) & (state.actors["id"] != state.ego_id) for state in states]
        return cls(
            path_m=sum(math.dist(*pair) for pair in pairwise(positions_m)),
            mean_speed_mps=float(speeds_mps.mean()),
            standing_share=float((speeds_mps < STANDING_MPS).mean()),
            boxes=float(np.mean([near.sum() for near in is_near])),
            collisions=sum(state.ego_id in event.ids for state in states for event in state.events),
        )

    def problems(self, rules: Acceptance) -> list[str]:
        """The rules that the motion breaks, in words; empty: none."""
        broken = {
            f"the ego's path has {self.path_m:.1f} m; min_path_m is {rules.min_path_m:g}": (
                self.path_m < rules.min_path_m
            ),
            f"the ego's mean speed is {self.mean_speed_mps:.2f} m/s; "
            f"min_mean_speed_mps is {rules.min_mean_speed_mps:g}": self.mean_speed_mps < rules.min_mean_speed_mps,
            f"the ego stands {self.standing_share:.0%} of the time; "
            f"max_standing_share is {rules.max_standing_share:g}": self.standing_share > rules.max_standing_share,
            f"{self.boxes:.1f} boxes on average; min_boxes is {rules.min_boxes:g}": self.boxes < rules.min_boxes,
            "the ego collides": rules.no_collision and self.collisions > 0,
        }
        return [words for words, is_broken in broken.items() if is_broken]


def rehearse(spec: SceneSpec, network: RoadNetwork, streetside: Streetside) -> SceneMotion:
    """Simulate a scene whose agents are driven by traffic, to its end, and return its motion.

    Args:
        spec: The scene.
        network: The roads of ``spec.map``.
        streetside: What stands at the streets, as for the scene itself.

    Raises:
        SimulationError: As from ``Simulation``.
    """
    states = []
    with Simulation(spec, network, *streetside[1:]) as simulation:
        ending = SceneEndDetector(spec, simulation.available)
        while True:
            state = simulation.step()
            if state.tick >= 0:
                states.append(state)
            if ending.end_at(state) is not None:
                return SceneMotion.of(states, spec)
