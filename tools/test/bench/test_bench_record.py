import json
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_bench_record_compares_with_the_mcap_package(tmp_path: Path) -> None:
    command = ["record", "--folder", str(tmp_path), "--ticks", "2", "--rounds", "1", "--json"]
    result = subprocess.run(
        [sys.executable, "-m", "tools.bench", *command], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    timings = json.loads(result.stdout)
    assert timings["tick_mb"]["raw"] > 6 * 1600 * 900 * 3 / 1e6
    ways = ("mcap package", "writer", "recorder node")
    assert [(each["topics"], each["way"]) for each in timings["timings"]] == [
        (kind, way) for kind in ("raw", "compressed") for way in ways
    ]
    for bare, *others in (timings["timings"][:3], timings["timings"][3:]):
        assert bare["ratio"] == 1
        for each in others:
            assert each["ratio"] == pytest.approx(each["mb_per_s"] / bare["mb_per_s"])
            assert 0 < each["size"] < 1.01 and each["cpu_s_per_gb"] > 0
    assert list(tmp_path.iterdir()) == []
