"""Builds the regions that scenes need and nobody has built yet, on all cores."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import lru_cache
from pathlib import Path

from simbev_ros.assets.static_cache import StaticCache
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Region
from simbev_ros.maps.spec import MapSpec


def build_regions(spec: MapSpec, regions: Sequence[Region], cache_dir: Path | None, built: Callable[[], None]) -> None:
    """Fill the cache.

    Args:
        spec: The map.
        regions: What to build of it.
        cache_dir: Of maps and regions; None: the default.
        built: Called after each region.

    Raises:
        InputError: The cache cannot be written.
    """
    workers = min(len(regions), os.cpu_count() or 1)
    if workers <= 1:
        for region in regions:
            _build(spec, region, cache_dir)
            built()
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_leave_interrupts_to_parent) as pool:
        try:
            for done in as_completed([pool.submit(_build, spec, region, cache_dir) for region in regions]):
                done.result()
                built()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _leave_interrupts_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _build(spec: MapSpec, region: Region, cache_dir: Path | None) -> None:
    """Build one region, in whatever process."""
    _cache(spec, cache_dir).region(region)


@lru_cache(maxsize=1)
def _cache(spec: MapSpec, cache_dir: Path | None) -> StaticCache:
    return StaticCache(spec, load_network(spec, cache_dir), cache_dir)
