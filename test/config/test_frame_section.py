"""The section frames of a configuration: what it refuses, and that it is left out where it says nothing."""

import pytest
from pydantic import ValidationError

from simbev_ros.config.base import first_problem
from simbev_ros.config.scenario import Scenario

PLAIN = {"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": []}}


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (
            {"base_link": "front_axle"},
            "frames.base_link: Input should be 'footprint' or 'rear_axle', not 'front_axle'",
        ),
        ({"odom": True, "publish": ["map_to_base_link"]}, "frames.publish.0: Input should be 'map_to_odom' or"),
        ({"publish": ["map_to_odom"]}, "frames: publish: its transforms exist with odom: true only"),
        ({"odom": True, "publish": ["map_to_odom"] * 2}, "frames: publish: a transform is listed twice"),
    ],
)
def test_bad_frames_are_refused(frames: object, message: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate(PLAIN | {"frames": frames})
    assert first_problem(caught.value).startswith(message)


def test_wheel_odometry_with_a_pose_is_refused() -> None:
    wheel = {"type": "odometry", "name": "wheel", "pose": {"x_m": 1}}
    with pytest.raises(ValidationError, match="pose: odometry has none, it describes the motion of base_link"):
        Scenario.model_validate(PLAIN | {"rig": {"sensors": [wheel]}})


def test_frames_are_in_the_configuration_of_a_bag() -> None:
    assert "rear_axle" in Scenario.model_validate(PLAIN | {"frames": {"base_link": "rear_axle"}}).as_yaml()
