"""Targets of fuzzing that answer others: the gate before viewers, their servers, and services of a running graph."""

import io
import json
import struct
from contextlib import suppress
from functools import cache
from http import HTTPStatus
from random import Random
from types import SimpleNamespace
from unittest import mock

import mutation
from builtin_interfaces.msg import Time
from made_up_scene import SENSORS, made_up_spec
from std_msgs.msg import String
from target import CORPUS, Target, write_file

from simbev_ros.config.load import parse_scenario
from simbev_ros.config.weather import WEATHER_PARAMETERS
from simbev_ros.foundation.errors import BagError, InputError, SimulationError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.join import Lockstep
from simbev_ros.production.serve import OrderDrawer
from simbev_ros.recording.image_codecs import decode_labels
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.reference_stack.scene import UsageError, read_scene
from simbev_ros.ros.graph.scene_queue import SceneOrder
from simbev_ros.ros.msgs.derived_messages import message_makers
from simbev_ros.ros.msgs.entity_messages import name_pattern
from simbev_ros.ros.msgs.tables import table_from_cdr
from simbev_ros.ros.nodes.graph_node import MALFORMED, _specification
from simbev_ros.ros.nodes.world_conditions import RunningScene, _parameters
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.access import has_token, is_own_host
from simbev_ros.show.foxglove.bag_player import BagPlayer
from simbev_ros.show.foxglove.derived import derivations
from simbev_ros.show.foxglove.graph_relay import GraphRelay
from simbev_ros.show.foxglove.playback_clock import PlaybackClock
from simbev_ros.show.foxglove.relayed_topics import GraphTransforms
from simbev_ros.show.gate import END_OF_HEAD, Gate
from simbev_ros.show.rerun.page_server import PageServer, _Handler

TOKEN, COOKIE = "fuzzed-token", "fuzzed-cookie"
"""Secrets of the servers, which the valid samples know."""
PORT = 9876
CONFIGURATION = "scenes: [{map: Blocks, train: 1}]\nrig: {sensors: []}\n"
"""Configuration of the graph that receives orders."""
REQUEST = struct.Struct("<BBfQ")
"""A request of a viewer's client: what it wants, topic or command, speed, and time to seek, ns."""


def _judge_head(data: bytes) -> None:
    """Judge the head of a request at the gate: who is admitted has the token, names this machine and is passed on."""
    gate = object.__new__(Gate)
    gate._token = TOKEN
    refusal, request = gate._judge(data)
    assert bool(refusal) != bool(request)
    if request:
        method, target, _ = data.partition(b"\r\n")[0].split(b" ")
        assert has_token(target.decode("latin-1"), TOKEN)
        assert request.startswith(method + b" / ") and TOKEN.encode() not in request.partition(b"\r\n")[0]
        hosts = [line for line in request.partition(END_OF_HEAD)[0].split(b"\r\n") if line.lower().startswith(b"host:")]
        assert not hosts or is_own_host(hosts[0].partition(b":")[2].strip().decode("latin-1"))


class _Connection:
    """A socket that has received some bytes, and keeps what is sent."""

    def __init__(self, data: bytes) -> None:
        self.received, self.sent = io.BytesIO(data), bytearray()
        self.close = self.shutdown = self.settimeout = lambda *_: None

    def makefile(self, *_: object) -> io.BytesIO:
        return self.received

    def recv(self, size: int) -> bytes:
        return self.received.read(size)

    def recv_into(self, buffer: memoryview) -> int:
        return self.received.readinto(buffer)

    def sendall(self, data: bytes) -> None:
        self.sent += data


def _answer_page(data: bytes) -> None:
    """Serve the viewer's page: without a secret, nothing is sent but a refusal."""
    server = object.__new__(PageServer)
    server.token, server.cookie, server.data = TOKEN, COOKIE, ("", 0)
    server.server_port, server.address = PORT, "127.0.0.1"
    server.file = lambda path: (HTTPStatus.OK, (), b"content")  # type: ignore[method-assign, assignment]
    connection = _Connection(data)
    unreachable = mock.Mock(**{"request.side_effect": OSError})
    with mock.patch("simbev_ros.show.rerun.page_server.HTTPConnection", return_value=unreachable):
        _Handler(connection, ("127.0.0.1", 1), server)  # type: ignore[arg-type]
    is_known = COOKIE.encode() in data or TOKEN.encode() in data or b"%" in data
    answer = bytes(connection.sent)
    assert is_known or not answer or answer.startswith((b"HTTP/1.0 4", b"HTTP/1.0 50", b"<!DOCTYPE"))
    assert b"content" not in answer.partition(b"\r\n\r\n")[2] or is_known


class _Played(Exception):
    """Ends the playback of a bag after what clients have asked for."""


class _Server:
    """The server of a player, which ends the playback when it tells the time."""

    def broadcast_time(self, stamp_ns: int) -> None:
        assert stamp_ns >= 0
        raise _Played

    def broadcast_playback_state(self, state: object) -> None:
        """Hear that the bag has ended."""


@cache
def _served_bag() -> SceneBag:
    return SceneBag(write_file("served/Blocks-0000_0.mcap", (CORPUS / "bag" / "valid").read_bytes()))


def _play_requests(data: bytes) -> None:
    """Serve a bag to clients with any requests, each as ``REQUEST``: kind, topic, speed and time to seek, ns."""
    import foxglove
    from foxglove.websocket import PlaybackCommand

    bag = _served_bag()
    start_ns, end_ns = bag.span_ns
    clock = PlaybackClock(start_ns, end_ns, start_ns)
    player = BagPlayer(bag, clock, foxglove.Context(), lambda _: None)
    topics = [*player._channels]
    for kind, number, speed, seek_ns in REQUEST.iter_unpack(data[: len(data) // REQUEST.size * REQUEST.size]):
        channel = SimpleNamespace(topic=topics[number % len(topics)])
        match kind % 4:
            case 0:
                player.on_subscribe(None, channel)
            case 1:
                player.on_unsubscribe(None, channel)
            case is_seek:
                request = {
                    "playback_command": PlaybackCommand.Play if number % 2 else PlaybackCommand.Pause,
                    "playback_speed": speed,
                    "seek_time": seek_ns if is_seek == 2 else None,
                    "request_id": "a",
                }
                player.on_playback_control_request(SimpleNamespace(**request))  # type: ignore[arg-type]
    player.on_subscribe(None, SimpleNamespace(topic=topics[0]))  # nothing waits for requests
    with suppress(_Played):
        player.play(_Server())  # type: ignore[arg-type]
    assert start_ns <= clock.position_ns <= end_ns and 0 < clock.speed <= 1000


def _relay(data: bytes) -> None:
    """Relay serialized messages of any process: nothing of theirs ends the relay."""
    relay = object.__new__(GraphRelay)
    relay._transforms, relay.server, relay.failure = GraphTransforms(), None, None
    relay._now_ns, relay._told_s, relay._warned, relay._channels, relay._latched = 0, 0.0, set(), {}, {}
    relay._warn = lambda _: None
    for receive in (relay._on_clock, relay._on_scene):
        relay._guarded(receive)(data)
    transforms = relay._transforms
    for kind, make in (
        ("std_msgs/msg/String", transforms.static),
        ("sensor_msgs/msg/PointCloud2", transforms.moving),
        ("visualization_msgs/msg/MarkerArray", None),
    ):
        fields = {"name": "a", "source_type": kind, "sources": ("a",), "make": make, "is_latched": True}
        relay._guarded(relay._forward)(SimpleNamespace(**fields), data)
    assert relay.failure is None, relay.failure


def _read_scene(data: bytes) -> None:
    """Read a message whose bytes the middleware has not looked at."""
    assert SceneSpec.from_json(_specification(data))


def _read_table(data: bytes) -> None:
    """Read the points of a cloud that the middleware has not looked at."""
    assert table_from_cdr(data, ("x", "y", "z")).ndim == 1


def _read_labels(data: bytes) -> None:
    """Read a camera's object ids."""
    assert decode_labels(data).ndim == 2


@cache
def _drawer() -> OrderDrawer:
    return OrderDrawer(parse_scenario(CONFIGURATION, "graph"), None)


def _load_scene(data: bytes) -> None:
    """Announce a scene to a stack that has joined the lockstep: what it takes, it can report."""
    lockstep = object.__new__(Lockstep)
    lockstep._node, lockstep._ready, lockstep._name, lockstep._load = mock.Mock(), mock.Mock(), "stack", None
    lockstep.scene, lockstep.period_ticks = None, 1
    lockstep._on_scene(String(data=data.decode(errors="replace").replace("\0", "")))
    for hour in range(4):
        lockstep.finished(Time(sec=3600 * hour))
    if lockstep.scene is not None:
        scene = read_scene(json.dumps(lockstep.scene), "/ego/lidar/points")
        assert scene.period_ticks >= 1


def _make_displays(data: bytes) -> None:
    """Make the displays that a bag does not hold from each of its messages."""
    with SceneBag(write_file("shown/Blocks-0000_0.mcap", data)) as bag:
        made, latest = derivations(bag), dict[str, RawMessage]()
        for message in bag.messages():
            latest[message.topic] = message
            for each in made.values():
                if each.sources[0] == message.topic and all(name in latest for name in each.sources):
                    assert each.make([latest[name] for name in each.sources])


def _draw_boxes(data: bytes) -> None:
    """Make what a recorder draws of boxes."""
    (make,) = message_makers(made_up_spec(SENSORS), (), ("/ego/boxes/markers",))["/ego/boxes"].values()
    assert make(data, 5)


def _draw_order(data: bytes) -> None:
    """Draw the scene of an order up to its map: seed and number, eight bytes each, and a configuration."""
    seed, number = (int.from_bytes(data[start : start + 8], "little", signed=True) for start in (0, 8))
    order = SceneOrder(data[16:].decode(errors="replace"), *(None if each == -1 else each for each in (seed, number)))
    with mock.patch("simbev_ros.production.serve.load_roads", side_effect=SimulationError("no map is built")) as roads:
        try:
            _drawer().draw(order)
        except SimulationError:
            assert roads.called


def mutate_order(sample: bytes, rng: Random) -> bytes:
    """Mutate the numbers or the configuration of an order."""
    if rng.randrange(4) == 0:
        return mutation.mutate_bytes(sample[:16], rng)[:16].ljust(16, b"\0") + sample[16:]
    return sample[:16] + mutation.mutate_yaml(sample[16:], rng)


@cache
def _running() -> RunningScene:
    return RunningScene(made_up_spec(SENSORS), None, 0, None, None)  # type: ignore[arg-type]


def _change_weather(data: bytes) -> None:
    """Read the parameters of a request for another weather, and change it."""
    datum = MapDatum(48.0, 11.0, 500.0)
    with mock.patch("simbev_ros.ros.nodes.world_conditions.load_datum", return_value=datum):
        parameters = _parameters(data.decode(errors="replace"), _running())
    assert parameters and parameters.keys() <= WEATHER_PARAMETERS.keys()
    course = WeatherCourse(_running().spec)
    course.change(parameters, 1, 2)
    for tick in range(4):
        assert type(course.at(tick)).model_validate(course.at(tick).model_dump())


def _find_names(data: bytes) -> None:
    """Find names with the filter of a request, which must not take long."""
    pattern = name_pattern(data.decode(errors="replace"))
    for name in ("ego", "vehicle.sedan_12", "a" * 64, "ab" * 32, "_" * 64):
        pattern.search(name)


_INPUT = (InputError,)
STACK_ERRORS = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)
"""What the reference stack ignores a scene for."""
SERVED_TARGETS = (
    Target("gate_head", _judge_head, ()),
    Target("page_head", _answer_page, ()),
    Target("client_requests", _play_requests, (), examples=40),
    Target("relayed_message", _relay, ()),
    Target("raw_scene", _read_scene, MALFORMED, corpus="relayed_message"),
    Target("raw_table", _read_table, MALFORMED, corpus="actors"),
    Target("labels", _read_labels, MALFORMED, mutation.mutate_png),
    Target("stack_scene", _load_scene, (*STACK_ERRORS, UsageError), mutation.mutate_json, corpus="scene"),
    Target("displays", _make_displays, (BagError,), corpus="bag", examples=40),
    Target("drawn_boxes", _draw_boxes, (ValueError,)),
    Target("scene_order", _draw_order, _INPUT, mutate_order, examples=15),
    Target("weather_order", _change_weather, _INPUT, mutation.mutate_yaml),
    Target("entity_filter", _find_names, _INPUT),
)
"""Targets of what is answered or relayed."""
