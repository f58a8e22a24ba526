"""``python -m tools.bench``: the benchmarks of parts, for those who change them. Prints tables, or JSON."""

from simbev_ros.cli.main import run_app
from tools.bench.cli.group import bench

if __name__ == "__main__":
    run_app(bench, "python -m tools.bench")
