"""Whatever bytes arrive, a reader refuses them with an error that it documents, or reads them consistently."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from targets import TARGETS, Target

from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE

_MIB = 1 << 20
_LIMIT_MIB = 16
_MAX_GROWTH_MIB = 300
"""Memory that a target may take beyond what was taken before: several times the limit, with room for caches."""
_MORE = 30
_DEADLINE_MS = 20_000
_PROFILE = settings(
    derandomize=True,
    database=None,
    deadline=_DEADLINE_MS,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],  # mutations are small as they are
)

# Numbers near the end of their range overflow; what counts is what is read from them.
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
each_target = pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)


@pytest.fixture(autouse=True)
def memory_limit(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, str(_LIMIT_MIB))
    Path("/proc/self/clear_refs").write_text("5")  # the peak of memory is from now on
    before_mib = peak_mib()
    yield
    assert peak_mib() - before_mib < _MAX_GROWTH_MIB


def peak_mib() -> float:
    """Largest resident memory of this process since it was reset, in MiB."""
    match = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    assert match is not None
    return int(match[1]) * 1024 / _MIB


@each_target
def test_valid_samples_are_accepted(target: Target) -> None:
    samples = target.samples("valid*")
    assert samples
    for data in samples.values():
        target.read(data)


@each_target
def test_the_corpus_is_read_or_refused(target: Target) -> None:
    for data in (b"", *target.samples().values()):
        target.run(data)


@each_target
def test_mutated_samples_are_read_or_refused(target: Target) -> None:
    run_mutations(target, target.examples)


@pytest.mark.slow
@each_target
def test_many_mutated_samples_are_read_or_refused(target: Target) -> None:
    run_mutations(target, _MORE * target.examples)


@pytest.mark.slow
def test_the_fuzzer_finds_its_targets_without_pytest() -> None:
    command = [sys.executable, str(Path(__file__).with_name("fuzz.py")), "--help"]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert ended.returncode == 0 and all(name in ended.stdout for name in TARGETS), ended.stderr


def run_mutations(target: Target, count: int) -> None:
    """Read mutations of all samples, and bytes without any order."""
    samples = st.sampled_from(list(target.samples().values()))
    mutations = st.builds(target.mutate, samples, st.randoms(use_true_random=False))

    @settings(_PROFILE, max_examples=count)
    @given(st.one_of(mutations, mutations, mutations, st.binary(max_size=100)))
    def read_or_refuse(data: bytes) -> None:
        target.run(data)

    read_or_refuse()
