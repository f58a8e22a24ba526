"""Replays on a Ray cluster: the bytes are those of one graph."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from commands import Find, Simbev
from generating import files, generate, write

pytest.importorskip("ray", reason="Ray is not installed: pip install -e .[cluster]")

from ray_nodes import RayNodes

pytestmark = [pytest.mark.graph, pytest.mark.slow]


@pytest.fixture
def nodes(find: Find) -> Iterator[RayNodes]:
    """Two nodes with two CPUs each; no process of ours may be left on them."""
    cluster = RayNodes(2)
    yield cluster
    cluster.close()


def test_a_cluster_records_the_bytes_of_one_graph(simbev: Simbev, nodes: RayNodes, tmp_path: Path) -> None:
    dataset, one, cluster = (tmp_path / name for name in ("dataset", "one", "cluster"))
    generate(simbev, write(tmp_path, "{map: Blocks, train: 2}, {map: Town01, val: 1}", has_lidar=False), dataset)
    night = write(tmp_path, "{map: Blocks, train: 1}")
    night.write_text(night.read_text().replace("sun_altitude_deg: 45", "sun_altitude_deg: -40"))
    for out, options in ((one, ()), (cluster, ("--ray", nodes.address))):
        code, output = simbev("replay", dataset, night, "--out", out, *options).finish(600)
        assert code == 0, output
    assert len(files(one)) == 3 and files(cluster) == files(one)
    assert sorted(path.name for path in cluster.iterdir()) == [".lock", "index.parquet", "logs", "plan.json", "scenes"]
