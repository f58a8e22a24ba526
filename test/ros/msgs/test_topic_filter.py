"""Patterns select the recorded topics; those that a replay needs are always recorded."""

import pytest
from pydantic import ValidationError

from simbev_ros.config.scenario import RecordedTopics
from simbev_ros.ros.msgs.topics import REPLAY_TOPICS, TopicFilter

CAMERA = "/ego/cam_front/rgb/image_raw/compressed"
NAMES = (CAMERA, "/ego/cam_front/rgb/camera_info", "/ego/lidar/points", "/tf")


@pytest.mark.parametrize(
    ("include", "exclude", "recorded"),
    [
        (["*"], [], set(NAMES)),
        (["/ego/*"], ["*/camera_info"], {CAMERA, "/ego/lidar/points"}),
        (["/ego/cam_?????/*"], [], {CAMERA, "/ego/cam_front/rgb/camera_info"}),
        (["/tf", "/ego/lidar"], [], {"/tf"}),
        (["*"], ["*"], set()),
    ],
)
def test_patterns_choose_topics(include: list[str], exclude: list[str], recorded: set[str]) -> None:
    chosen = TopicFilter(RecordedTopics(include=tuple(include), exclude=tuple(exclude)))
    assert {name for name in NAMES if name in chosen} == recorded
    assert all(name in chosen for name in REPLAY_TOPICS)


@pytest.mark.parametrize("patterns", [{"include": []}, {"include": ["ego/*"]}, {"exclude": ["rgb"]}])
def test_patterns_that_match_no_topic_are_refused(patterns: dict[str, list[str]]) -> None:
    with pytest.raises(ValidationError):
        RecordedTopics.model_validate(patterns)
