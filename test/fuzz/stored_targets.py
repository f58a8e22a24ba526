"""Targets of fuzzing that read what is stored: models, caches, locks, maps of other forms, and secrets."""

import bz2
import gzip
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

import mutation
import pytest
import zstandard
from target import Target, folder, write_file

from simbev_ros.baselines.inference import ABOUT_KEY, Baseline
from simbev_ros.config.evaluation_file import load_evaluation
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.evaluation.realism.samples import READERS, samples_of_folder
from simbev_ros.evaluation.realism.statistics import figures_of
from simbev_ros.export.parts import Part
from simbev_ros.foundation.cache import seals
from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.cache.folders import ensure_folder
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.lock_file import lock_file, open_lock_file
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.maps.lanelet2.projector_info import FILE_NAME, datum_of_file
from simbev_ros.maps.osm.reader import read_osm
from simbev_ros.show.access import _read_own

THING = b"what a cache holds, which nobody else can change"
"""Content of the entries of caches; more than that is not stored."""


def _read_model(data: bytes) -> None:
    """Read what a model says of itself: a line with the shape of its images as JSON, and then its metadata."""
    line, _, text = data.partition(b"\n")
    shape = parse_json(line)

    class Session:
        """What ONNX Runtime makes of a file."""

        def get_modelmeta(self) -> Any:
            return SimpleNamespace(custom_metadata_map={ABOUT_KEY: text.decode()})

        def get_inputs(self) -> list[Any]:
            return [SimpleNamespace(name="images", shape=shape)]

        def get_outputs(self) -> list[Any]:
            return []

    with mock.patch("simbev_ros.baselines.inference.open_session", return_value=Session()):
        baseline = Baseline(Path("a.onnx"))
    ages_ns = baseline.sweep_ages_ns
    assert 1 <= len(ages_ns) <= 64 and list(ages_ns) == sorted(ages_ns) and 0 <= ages_ns[0] <= ages_ns[-1] <= 60e9
    width_px, height_px = baseline.camera_size_px or (1, 1)
    assert width_px > 0 < height_px and 0 <= baseline.cameras * width_px * height_px <= 1 << 28


def mutate_model(sample: bytes, rng: Random) -> bytes:
    """Mutate the shape of a model's images or its metadata."""
    line, _, text = sample.partition(b"\n")
    if rng.randrange(3) == 0:
        return mutation.mutate_json(line, rng).replace(b"\n", b" ") + b"\n" + text
    return line + b"\n" + mutation.mutate_json(text, rng)


def _use_file(data: bytes) -> None:
    """Use a cached file after its content, or for an odd first byte its seal, has been replaced."""
    path = folder() / "cache" / "files" / "entry" / "thing"

    def write(target: Path) -> None:
        target.write_bytes(THING)

    assert read_cached(path, "things", Path.read_bytes, write) == THING
    (path.with_name(".thing.sha256") if data[:1] and data[0] % 2 else path).write_bytes(data[1:])
    seals._checked.clear()
    assert read_cached(path, "things", Path.read_bytes, write) == THING


def _use_folder(data: bytes) -> None:
    """Use a cached folder after a file or its seal has been replaced, or a file has been added."""

    def build(work: Path) -> None:
        (work / "thing").write_bytes(THING)

    def entry() -> Path:
        return ensure_folder("folders", "entry", b"1", b"", build, folder() / "cache")

    (entry() / ("thing", ".sha256", "more")[data[0] % 3 if data else 0]).write_bytes(data[1:])
    seals._checked.clear()
    assert [path.name for path in entry().glob("[!.]*")] == ["thing"] and (entry() / "thing").read_bytes() == THING


def _meet_lock(data: bytes) -> None:
    """Meet a locked dataset whose lock file holds anything: one line says who writes."""
    path = write_file("locked/.lock", data)
    holder = open_lock_file(path)
    try:
        lock_file(holder)
        with pytest.raises(InputError) as caught:
            DatasetLock(path.parent)
        assert str(caught.value).isprintable() and str(caught.value).endswith(" is writing into it"), caught.value
        assert path.read_bytes() == data
    finally:
        os.close(holder)


def _read_token(data: bytes) -> None:
    """Read the token of a user: it can be a part of an address, or another one is made."""
    path = write_file("token", data)
    path.chmod(0o600)
    token = _read_own(path)
    assert token is None or (token.isascii() and token.isprintable() and len(token) >= 16)


def _read_map(suffix: str, data: bytes) -> None:
    """Read the elements of an OpenStreetMap file, up to where roads are made."""
    read_osm(write_file(f"elements{suffix}", data))


def _read_projector(data: bytes) -> None:
    """Read the projector of a Lanelet2 map."""
    datum = datum_of_file(write_file(f"projected/{FILE_NAME}", data))
    assert datum is None or (abs(datum.latitude_deg) <= 90 and abs(datum.longitude_deg) <= 180)


def _read_evaluation(data: bytes) -> None:
    """Read the section ``evaluation`` of a configuration."""
    evaluation = load_evaluation(write_file("evaluation.yaml", data))
    assert type(evaluation).model_validate(evaluation.model_dump()) == evaluation


def _read_part(data: bytes) -> None:
    """Look at the record of a part of an export: it is finished if it was made from the same."""
    part = Part(out=folder() / "exported", name="a", identity={"made_from": "b"}, patterns=())
    part._record_path.parent.mkdir(parents=True, exist_ok=True)
    part._record_path.write_bytes(data)
    record = part.record()
    assert record is None or record["made_from"] == "b"


def _read_frame(data: bytes) -> None:
    """Read a frame of another data set: a line with the ending of its file, and then the file."""
    suffix, _, content = data.partition(b"\n")
    if suffix.decode("latin1") not in READERS:
        return
    place = write_file(f"frames/frame{suffix.decode()}", content)
    try:
        figures = [figures_of(samples) for samples in samples_of_folder(place.parent, 2).values()]
    finally:
        place.unlink()
    assert all(isinstance(value, float | int) for each in figures for value in each.values())


def mutate_frame(sample: bytes, rng: Random) -> bytes:
    """Mutate the file of a frame."""
    suffix, _, content = sample.partition(b"\n")
    return suffix + b"\n" + mutation.mutate_bytes(content, rng)


_PACKERS: dict[str, tuple[Callable[[bytes], bytes], Callable[[bytes], bytes]]] = {
    "gz": (gzip.compress, gzip.decompress),
    "bz2": (bz2.compress, bz2.decompress),
    "zst": (zstandard.compress, zstandard.decompress),
}


def mutate_packed(sample: bytes, rng: Random) -> bytes:
    """Mutate compressed XML before or after its compression, and pack it in another way."""
    for _, unpack in _PACKERS.values():
        try:
            text = unpack(sample)
        except Exception:  # another compression, or a damaged one
            continue
        pack, _ = _PACKERS[sorted(_PACKERS)[rng.randrange(len(_PACKERS))]]
        packed = pack(mutation.mutate_xml(text, rng))
        return packed if rng.randrange(2) else mutation.mutate_bytes(packed, rng)
    return mutation.mutate_bytes(sample, rng)


_INPUT = (InputError,)
STORED_TARGETS = (
    Target("model", _read_model, (InputError, ValueError), mutate_model),
    Target("cache_file", _use_file, (), examples=60),
    Target("cache_folder", _use_folder, (), examples=60),
    Target("lock", _meet_lock, ()),
    Target("token", _read_token, ()),
    Target("osm_packed", partial(_read_map, ".osm"), _INPUT, mutate_packed, examples=60),
    Target("osm_pbf", partial(_read_map, ".osm.pbf"), _INPUT, mutation.mutate_pbf, examples=20),
    Target("projector", _read_projector, _INPUT, mutation.mutate_yaml),
    Target("evaluation", _read_evaluation, _INPUT, mutation.mutate_yaml, examples=60),
    Target("export_part", _read_part, (), mutation.mutate_json),
    Target("real_frame", _read_frame, _INPUT, mutate_frame),
)
"""Targets of what is stored."""
