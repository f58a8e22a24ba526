import os
import subprocess
import threading
from mmap import MAP_ANONYMOUS, MAP_PRIVATE, PAGESIZE, mmap
from pathlib import Path

import pytest

from simbev_ros.foundation.errors import GraphError
from tools.bench.resource_use import ResourceSampler


def test_memory_descriptors_threads_and_files_that_a_process_takes_are_counted(tmp_path: Path) -> None:
    sampler, pids = ResourceSampler([tmp_path]), {"this": os.getpid()}
    stop = threading.Event()
    sampler.sample(pids)
    memory = mmap(-1, 64 << 20, MAP_PRIVATE | MAP_ANONYMOUS)  # freed memory that is kept cannot serve for it
    memory[::PAGESIZE] = bytes(len(memory) // PAGESIZE)
    thread = threading.Thread(target=stop.wait)
    thread.start()
    file = tmp_path / "nested" / "file"
    file.parent.mkdir()
    with file.open("wb") as stream:
        stream.write(bytes(2 << 20))
        stream.flush()
        sampler.sample(pids)
    stop.set()
    thread.join()
    before, after = (sample.processes["this"] for sample in sampler.samples)
    assert after.memory_mib - before.memory_mib == pytest.approx(len(memory) / 2**20, abs=8)
    assert (after.descriptors - before.descriptors, after.threads - before.threads) == (1, 1)
    before, after = (sample.temporary for sample in sampler.samples)
    assert (before.files, after.files) == (0, 1)
    assert after.size_mib == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("is_reaped", [True, False])
def test_a_process_that_has_ended_is_an_error(tmp_path: Path, *, is_reaped: bool) -> None:
    with subprocess.Popen(["true"], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.read()  # to its end
        if is_reaped:
            process.wait()
        else:
            os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        with pytest.raises(GraphError, match="a process of the graph has ended"):
            ResourceSampler([tmp_path]).sample({"gone": process.pid})
