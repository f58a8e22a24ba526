"""The camera node: renders its cameras' images of each due tick and publishes them, raw and compressed.

Its cameras may belong to several agents, which share the uploaded meshes and are rendered one after the other.

An image is drawn, read back, encoded and sent only if its topic has a reader. A recorder is a reader like any other, an
annotator is one at ticks with labels. The same holds for colored pictures. In lockstep, threads encode the images of a
tick while those of the next one are drawn.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from itertools import chain, groupby
from typing import NamedTuple

from rclpy.serialization import serialize_message

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.modalities import IMAGE_KINDS, Modality
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Recording
from simbev_ros.drawing.displays.detections import label_info
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray
from simbev_ros.recording.image_codecs import compressed_format, encode_image
from simbev_ros.recording.video import Encode, VideoStream
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.displays import SceneDisplay
from simbev_ros.ros.msgs.images import camera_info_message, compressed_image_message, image_message, video_message
from simbev_ros.ros.msgs.message_types import require_installed
from simbev_ros.ros.msgs.sensor_topics import CameraTopics
from simbev_ros.ros.nodes.camera_groups import CameraGroup, MountedCamera, camera_groups
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.ros.nodes.surroundings import Surroundings
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.gl.context import open_context
from simbev_ros.simulation.render.renderer import READ_BACK, Renderer


class _Output(NamedTuple):
    """One modality of a camera at a tick.

    Attributes:
        mounted: The camera.
        modality: The modality.
        read: Names of those topics that have readers.
        displays: Its displays that have readers.
        image: The image; None: it is not drawn.
    """

    mounted: MountedCamera
    modality: Modality
    read: frozenset[str]
    displays: Sequence[SceneDisplay]
    image: AnyArray | None = None

    @property
    def topics(self) -> CameraTopics:
        """Topics of the image."""
        return self.mounted.topics[self.modality]

    @property
    def encoding(self) -> str:
        """ROS encoding of the image."""
        return IMAGE_KINDS[self.modality].encoding


class _Encoded(NamedTuple):
    """Forms of an image that threads make.

    Attributes:
        compressed: The compressed image; None: it has no reader.
        video: The image in the video; None: there is none, or it has no reader.
        pictures: Messages with its colored picture, by topic.
    """

    compressed: bytes | None
    video: bytes | None
    pictures: Mapping[str, bytes]


class CameraNode(Participant):
    """Renders the images of the cameras that its parameter ``sensors`` names."""

    reuses_large_buffers = True

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._names = self.declare_read_only(
            "sensors", [], "Cameras that this node serves, as agent/camera, or camera of every agent; empty: all"
        )
        self._compressed = self.declare_read_only(
            "compressed", True, "Record the compressed image topics instead of the raw ones"
        )
        recording = self.declare_section("recording", Recording)
        self._jpeg_quality, self._depth_form = recording.jpeg_quality, recording.depth
        rendering = self.declare_section("rendering", Rendering)
        process = self.declare_read_only(
            "process", 0, "Index of this process among those that share the cameras", minimum=0
        )
        self._quality = rendering.quality
        self._open_context = partial(open_context, rendering.device_of(process), process)
        self._open_context().release()  # a machine that cannot draw is reported before anything is loaded
        self._surroundings = Surroundings(self._make_renderer, Renderer.close)
        self._groups: list[CameraGroup] = []
        self._outputs: list[_Output] = []
        self._encoders = self.meter.pool("encode")
        self._videos: dict[str, VideoStream] = {}

    def _make_renderer(self, static: StaticScene) -> Renderer:
        return Renderer(static, load_models(), self._open_context(), self._quality, self._time_part)

    def _time_part(self, name: str) -> AbstractContextManager[None]:
        """Time the reading of images, which waits for OpenGL; all else that a renderer does counts as drawing."""
        return self.meter.part("read back") if name == READ_BACK else nullcontext()

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the agents (kept while scenes stay there) and advertise the cameras' topics."""
        self._groups = list(camera_groups(self.served_views(spec), self._names))
        self._outputs.clear()
        self._videos.clear()
        renderer = self._surroundings.load(spec)
        renderer.set_lights(spec.lights)
        renderer.set_appearance(spec.appearance)
        renderer.set_agents(len({group.view.agent for group in self._groups}))
        recorded = list(self._advertise())
        self.advertise_derived(spec)
        self._publish_label_info(spec)
        return recorded

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether any camera takes a picture."""
        return tick >= 0 and any(tick % group.period_ticks == 0 for group in self._groups)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Render the images that are due; flow refers to the camera's own previous frame."""
        for group in self._groups:
            if state.tick % group.period_ticks:
                continue
            frame = RenderFrame(group.view.ego_state(state), group.previous)
            outputs = self._due_outputs(group.cameras, state.tick)
            if not self.is_sensed(state.tick):  # the flow of the first image needs the image before it
                is_needed = state.tick + group.period_ticks == 0
                outputs = [output for output in outputs if is_needed and output.modality == "flow"]
            with self.meter.part("draw"):
                outputs = self._render(group, outputs, frame)
            if state.tick >= 0:
                self._outputs += outputs
            group.previous = frame.world

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Start to compress the images of a tick, which is finished when they are published."""
        outputs, self._outputs = self._outputs, []
        encoded = [
            self._encoders.submit(self._encode, state.stamp_ns, output, self._next_of_video(output))
            for output in outputs
        ]
        publish = partial(self._publish, state.stamp_ns, outputs, encoded)
        self.finish_after(spec, state.tick, encoded, publish)

    def _due_outputs(self, cameras: Iterable[MountedCamera], tick: int) -> list[_Output]:
        """All modalities of the given cameras, and which of their topics have readers at a tick."""
        outputs = []
        for mounted in cameras:
            for modality, topics in mounted.topics.items():
                displays = [each for each in self.displays_of(topics.raw.name) if self.reader_count(each.topic.name)]
                forms = (topics.raw, topics.compressed, *filter(None, (topics.video,)))
                read = frozenset(topic.name for topic in forms if self.is_needed(topic.name, tick))
                outputs.append(_Output(mounted, modality, read, displays))
        return outputs

    def _render(self, group: CameraGroup, outputs: list[_Output], frame: RenderFrame) -> list[_Output]:
        """Render the outputs that have readers; return all outputs, with the images of the rendered ones."""
        wanted: dict[MountedCamera, list[Modality]] = {}
        for output in outputs:
            if output.read or output.displays:
                wanted.setdefault(output.mounted, []).append(output.modality)
        views = [
            CameraView.from_config(
                mounted.camera, group.noise_seed, frame.world.tick, modalities, lens_seed=group.lens_seed
            )
            for mounted, modalities in wanted.items()
        ]
        images = dict(zip(wanted, self._surroundings.built.render(views, frame), strict=True)) if views else {}
        return [output._replace(image=getattr(images.get(output.mounted), output.modality, None)) for output in outputs]

    def _publish(self, stamp_ns: int, outputs: list[_Output], encoded_images: list[Future[_Encoded]]) -> None:
        """Publish the images of a tick, and the CameraInfo of each camera on the topics that share it."""
        pairs = zip(outputs, encoded_images, strict=True)
        for mounted, of_camera in groupby(pairs, key=lambda pair: pair[0].mounted):
            info = serialize_message(camera_info_message(mounted.camera.model, stamp_ns, mounted.frame))
            for output, future in of_camera:
                self._publish_image(output, future.result(), stamp_ns)
                self.publish(output.topics.info.name, info)
            self.publish(mounted.info.name, info)

    def _publish_image(self, output: _Output, encoded: _Encoded, stamp_ns: int) -> None:
        """Publish one image in all forms that have readers."""
        if output.image is None:
            return
        frame_id = output.mounted.frame
        if output.topics.raw.name in output.read:
            self.publish(output.topics.raw.name, image_message(output.image, stamp_ns, frame_id, output.encoding))
        if encoded.compressed is not None:
            image_format = compressed_format(output.encoding, self._depth_form)
            message = compressed_image_message(encoded.compressed, image_format, stamp_ns, frame_id)
            self.publish(output.topics.compressed.name, message)
        if encoded.video is not None and output.topics.video is not None:
            self.publish(output.topics.video.name, video_message(encoded.video, stamp_ns, frame_id))
        for name, picture in encoded.pictures.items():
            self.publish(name, picture)

    def _next_of_video(self, output: _Output) -> Encode | None:
        """Encoder of an image as the next one of its video; None if that has no reader."""
        topic = output.topics.video
        if topic is None or topic.name not in output.read or output.image is None:
            return None
        if topic.name not in self._videos:
            self._videos[topic.name] = VideoStream(output.mounted.camera.width_px, output.mounted.camera.height_px)
        return self._videos[topic.name].announce()

    def _encode(self, stamp_ns: int, output: _Output, next_of_video: Encode | None) -> _Encoded:
        """Compress an image, and color it, if these forms have readers."""
        image, compressed = output.image, None
        if image is None:
            return _Encoded(None, None, {})
        video = None if next_of_video is None else next_of_video(image)
        if output.topics.compressed.name in output.read:
            jpeg_quality = output.mounted.jpeg_quality or self._jpeg_quality
            compressed = encode_image(output.encoding, image, jpeg_quality, self._depth_form)
        return _Encoded(compressed, video, {each.topic.name: each.make(stamp_ns, image) for each in output.displays})

    def _advertise(self) -> Iterator[str]:
        """Create the publishers; yield the names of the topics that can be recorded."""
        cameras = [mounted for group in self._groups for mounted in group.cameras]
        for mounted in cameras:
            self.advertise(mounted.info)
            yield mounted.info.name
            for topics in mounted.topics.values():
                if topics.video is not None:
                    require_installed(topics.video.type, f"{mounted.camera.name}: video")
                for topic in filter(None, topics):
                    self.advertise(topic)
                yield from (topic.name for topic in topics.recorded(compressed=self._compressed))

    def _publish_label_info(self, spec: SceneSpec) -> None:
        """Publish the names of the classes in semantic images."""
        names = {int(tag): tag.name.lower() for tag in Tag}
        for mounted in chain.from_iterable(group.cameras for group in self._groups):
            if mounted.label_info is not None:
                self.advertise(mounted.label_info)
                self.publish_once(mounted.label_info, label_info, names, spec.start_ns, mounted.frame)

    def close(self) -> None:
        """Stop the encoding threads and free the GL resources."""
        self._encoders.shutdown()
        self._surroundings.close()
