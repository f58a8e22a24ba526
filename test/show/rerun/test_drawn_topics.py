"""The viewer subscribes to what it draws, and to nothing else."""

from made_up_scene import SENSORS, made_up_spec

from simbev_ros.config.modalities import IMAGE_KINDS, MODALITIES
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.show.rerun.live.drawn_topics import drawn_topics

SPEC = made_up_spec(SENSORS)
SHOWN = {
    *("/ego/odom", "/world/events", "/ego/bev/labels", "/ego/boxes"),
    *("/ego/cam_front/rgb/image_raw", "/ego/cam_back_left/rgb/image_raw"),
    *("/ego/cam_front/boxes", "/ego/cam_back_left/boxes"),
    *("/ego/lidar/points", "/ego/radar_front/points", "/ego/gnss/fix", "/ego/imu/data"),
}


def test_without_layers_nothing_is_read_that_is_hidden_at_first() -> None:
    assert {topic.name for topic in drawn_topics(agent_view(SPEC), lambda forms: forms.raw, layers=False)} == SHOWN


def test_layers_are_read_in_the_chosen_form() -> None:
    names = {topic.name for topic in drawn_topics(agent_view(SPEC), lambda forms: forms.compressed, layers=True)}
    assert names - SHOWN == {
        *("/ego/lidar/semantic_points", "/ego/occupancy/points"),
        *(f"/ego/{camera}/rgb/image_raw/compressed" for camera in ("cam_front", "cam_back_left")),
        *(
            f"/ego/{camera}/{modality}/image_raw/{IMAGE_KINDS[modality].transport}"
            for camera in ("cam_front", "cam_back_left")
            for modality in MODALITIES
            if modality != "rgb"
        ),
    }
