"""The camera node: renders its cameras' images of each due tick and publishes them, raw and compressed."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from typing import NamedTuple

from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from simbev_ros.assets.catalogue import load_models
from simbev_ros.config.rig import Camera, Modality
from simbev_ros.msgs.images import camera_info_message, compressed_image_message, encoding_of, image_message
from simbev_ros.msgs.topics import Topic, camera_info_topic, compressed_topic, image_topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.surroundings import Surroundings
from simbev_ros.recording.image_codecs import compressed_format, encode
from simbev_ros.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.render.renderer import Renderer
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.types import AnyArray


class _Output(NamedTuple):
    camera: Camera
    modality: Modality
    image: AnyArray


class CameraNode(Participant):
    """Serves the cameras named in its parameter ``sensors``."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._names = self.declared("sensors", [], "Names of the rig's cameras that this node serves; empty: all")
        self._compressed = self.declared("compressed", True, "Record the compressed image topics instead of the raw")
        self._renderer: Renderer | None = None
        self._surroundings = Surroundings()
        self._cameras: list[Camera] = []
        self._previous: dict[int, WorldState] = {}
        self._encoders = ThreadPoolExecutor(max_workers=os.cpu_count())

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the ego (kept while scenes stay there) and advertise the cameras' topics."""
        static = self._surroundings.changed(spec)
        if static is not None:
            if self._renderer is not None:
                self._renderer.close()
            self._renderer = Renderer(static, load_models())
        assert self._renderer is not None
        self._renderer.set_lights(spec.lights)
        cameras = [c for c in spec.rig.of_type(Camera) if not self._names or c.name in self._names]
        self._cameras = sorted(cameras, key=lambda camera: spec.period_ticks(camera.rate_hz))
        self._previous.clear()
        return list(self._advertise(spec))

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether any camera takes a picture."""
        return tick >= 0 and any(tick % spec.period_ticks(camera.rate_hz) == 0 for camera in self._cameras)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Render what is due. The flow's previous frame is the camera's own, not the last tick."""
        for period, cameras in groupby(self._cameras, key=lambda camera: spec.period_ticks(camera.rate_hz)):
            if state.tick % period:
                continue
            frame = RenderFrame(state, self._previous.get(period))
            outputs = self._rendered(list(cameras), frame)
            if state.tick >= 0:  # pictures of the lead-in only warm the renderer up
                self._publish(spec, outputs, frame)
            self._previous[period] = state

    def _rendered(self, cameras: list[Camera], frame: RenderFrame) -> list[_Output]:
        assert self._renderer is not None
        views = [CameraView(c.model, c.pose.ego_from_sensor, c.modalities) for c in cameras]
        return list(_outputs(cameras, self._renderer.render(views, frame)))

    def _publish(self, spec: SceneSpec, outputs: list[_Output], frame: RenderFrame) -> None:
        agent, stamp_ns = spec.rig.agent, frame.world.stamp_ns
        encoded = self._encoders.map(lambda output: self._encoded(agent, output), outputs)
        for output, data in zip(outputs, encoded, strict=True):
            frame_id = f"{agent}/{output.camera.name}_optical"
            raw = image_topic(agent, output.camera.name, output.modality)
            if self.readers(raw):
                self.publish(raw, image_message(output.image, stamp_ns, frame_id))
            if data is not None:
                message = compressed_image_message(data[0], data[1], stamp_ns, frame_id)
                self.publish(compressed_topic(agent, output.camera.name, output.modality), message)
            info = camera_info_message(output.camera.model, stamp_ns, frame_id)
            self.publish(camera_info_topic(agent, output.camera.name, output.modality), info)

    def _encoded(self, agent: str, output: _Output) -> tuple[bytes, str] | None:
        """Compressed bytes and format, where somebody listens."""
        if not self.readers(compressed_topic(agent, output.camera.name, output.modality)):
            return None
        encoding = encoding_of(output.image)
        return encode(encoding, output.image), compressed_format(encoding)

    def _advertise(self, spec: SceneSpec) -> Iterator[str]:
        """Make the publishers; give the topics that a recorder takes."""
        agent = spec.rig.agent
        for camera in self._cameras:
            for modality in camera.modalities:
                raw = image_topic(agent, camera.name, modality)
                compressed = compressed_topic(agent, camera.name, modality)
                info = camera_info_topic(agent, camera.name, modality)
                self.advertise(Topic(raw, "sensor_msgs/msg/Image", sensor=True), Image)
                self.advertise(Topic(compressed, "sensor_msgs/msg/CompressedImage", sensor=True), CompressedImage)
                self.advertise(Topic(info, "sensor_msgs/msg/CameraInfo", sensor=True), CameraInfo)
                yield compressed if self._compressed else raw
                yield info

    def close(self) -> None:
        """Free the GL resources."""
        self._encoders.shutdown()
        if self._renderer is not None:
            self._renderer.close()


def _outputs(cameras: list[Camera], images: list[CameraImages]) -> Iterator[_Output]:
    for camera, rendered in zip(cameras, images, strict=True):
        for modality in camera.modalities:
            yield _Output(camera, modality, getattr(rendered, modality))
