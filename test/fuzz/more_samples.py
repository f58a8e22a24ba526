"""Valid samples of what servers receive and of what is stored, of which ``samples.py`` writes the files."""

import bz2
import gzip
import hashlib
import io
import json
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import osmium
import pyarrow as pa
import ros_messages
import zstandard
from pyarrow import feather
from served_targets import COOKIE, PORT, REQUEST, TOKEN
from stored_targets import THING

from simbev_ros.recording.image_codecs import encode_image
from simbev_ros.schema.scene.spec import SceneSpec


def served_samples(spec: SceneSpec) -> Iterator[tuple[str, str, bytes]]:
    """Yield what clients send to servers."""
    query = f"?token={TOKEN}"
    heads = {
        "valid": f"GET /{query} HTTP/1.1\r\nHost: localhost:{PORT}\r\nOrigin: http://localhost:{PORT}\r\n\r\n",
        "valid_cookie": f"GET /a.js HTTP/1.1\r\nHost: [::1]:{PORT}\r\nCookie: simbev-{PORT}={COOKIE}\r\n\r\n",
        "valid_call": f"POST /a HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: simbev-{PORT}={COOKIE}\r\n"
        "Content-Length: 3\r\n\r\nabc",
    }
    yield (
        "gate_head",
        "valid",
        f"GET /a{query}&b=c HTTP/1.1\r\nHost: 127.0.0.1:1\r\nUpgrade: websocket\r\n\r\nmore".encode(),
    )
    yield from (("page_head", name, head.encode()) for name, head in heads.items())
    requests = [(0, 1, 0.0, 0), (0, 4, 0.0, 0), (2, 1, 2.0, spec.start_ns), (3, 0, 0.5, 0), (1, 4, 0.0, 0)]
    yield "client_requests", "valid", b"".join(REQUEST.pack(*each) for each in requests)
    yield "relayed_message", "valid", ros_messages.string(spec.model_dump_json())
    yield "labels", "valid", encode_image("mono16", np.arange(12, dtype=np.uint16).reshape(3, 4))
    order = b"scenes: [{map: Blocks, train: 1}]\nrig: {sensors: [{type: imu, name: imu}]}\nweather: {wetness: 3}\n"
    yield "scene_order", "valid", struct.pack("<qq", 7, -1) + order
    yield "scene_order", "valid_as_configured", struct.pack("<qq", -1, 12)
    yield "weather_order", "valid", b"{precipitation: 80, fog_density: {uniform: [10, 20]}, wetness: 3.5}"
    yield "weather_order", "valid_sun", b"sun: {date: 2026-06-21, hour: {uniform: [8, 12]}, latitude_deg: 48}"


def stored_samples(osm: str) -> Iterator[tuple[str, str, bytes]]:
    """Yield files of the user's folders, and maps of other forms."""
    about = {"modality": "fused", "sweep_ages_s": [0.0, 0.25, 2], "training": {"batch_size": 4}}
    yield "model", "valid", b"[6, 256, 704, 3]\n" + json.dumps(about).encode()
    yield "cache_file", "valid", b"\0" + THING
    yield "cache_file", "valid_seal", b"\1" + hashlib.sha256(THING).hexdigest().encode()
    yield "cache_folder", "valid", b"\0" + THING
    yield "lock", "valid", b""
    yield "token", "valid", b"abcdefghijklmnopqrstuv"
    yield "osm_packed", "valid_gz", gzip.compress(osm.encode(), mtime=0)
    yield "osm_packed", "valid_bz2", bz2.compress(osm.encode())
    yield "osm_packed", "valid_zst", zstandard.compress(osm.encode())
    yield "osm_pbf", "valid", _pbf(osm, "none")
    yield "osm_pbf", "valid_packed", _pbf(osm, "zlib")
    origin = "map_origin: {latitude: 48.1, longitude: 11.5, altitude: 500}\n"
    yield "projector", "valid", f"projector_type: TransverseMercator\nvertical_datum: WGS84\n{origin}".encode()
    yield "projector", "valid_mgrs", b"projector_type: MGRS\nmgrs_grid: 54SUE\n"
    yield (
        "evaluation",
        "valid",
        b"evaluation: {range_m: 50, rings_m: [10, 30], min_points: 1, truth: joint, answers_to: /ego/lidar/points}\n",
    )
    yield from (("real_frame", f"valid_{suffix}", f".{suffix}\n".encode() + data) for suffix, data in _frames())
    yield "export_part", "valid", json.dumps({"made_from": "b", "frames": 3}).encode()


def _frames() -> Iterator[tuple[str, bytes]]:
    """Small frames of other data sets by the endings of their files."""
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-9.0, 9.0, (40, 3)), rng.random(40)]).astype(np.float32)
    yield "bin", points.tobytes()
    stream = io.BytesIO()
    columns = dict(zip("xyz", points[:, :3].T.astype(np.float16), strict=True))
    columns |= {"intensity": np.arange(40, dtype=np.uint8), "laser_number": np.arange(40, dtype=np.uint8) % 4}
    feather.write_feather(pa.table(columns), stream, compression="uncompressed")
    yield "feather", stream.getvalue()
    image = rng.integers(0, 255, (24, 32, 3), np.uint8)
    yield from ((ending, cv2.imencode(f".{ending}", image)[1].tobytes()) for ending in ("png", "jpg"))
    head = b"VERSION 0.7\nFIELDS x rcs\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nPOINTS 2\nDATA binary\n"
    yield "pcd", head + np.array([[1.0, -8.0], [2.0, 4.0]], np.float32).tobytes()


def _pbf(osm: str, compression: str) -> bytes:
    """A file of OpenStreetMap as PBF."""
    with tempfile.TemporaryDirectory() as name:
        source, target = Path(name, "a.osm"), Path(name, "a.osm.pbf")
        source.write_text(osm)
        with osmium.SimpleWriter(osmium.io.File(str(target), f"pbf,pbf_compression={compression}")) as writer:
            for element in osmium.FileProcessor(str(source)):
                writer.add(element)
        return target.read_bytes()
