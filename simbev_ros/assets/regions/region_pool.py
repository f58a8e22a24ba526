"""Builds the regions that are missing in the cache, in parallel on all cores."""

import gc
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from pathlib import Path

from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Region
from simbev_ros.schema.scene.map_spec import MapSpec

_ENDED = 1


def build_regions(spec: MapSpec, regions: Sequence[Region], cache_dir: Path | None, built: Callable[[], None]) -> None:
    """Build regions into the cache. Any error or interrupt stops all workers and leaves no partial files.

    Args:
        spec: Specification of the map.
        regions: Regions to build.
        cache_dir: Cache directory of maps and regions; None for the default.
        built: Called after each region that has been built.

    Raises:
        InputError: The cache cannot be written.
        SimulationError: A worker process was killed, as happens when memory runs out.
    """
    workers = min(len(regions), usable_cores())
    if workers <= 1:
        for region in regions:
            _build(spec, region, cache_dir)
            built()
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_set_up_worker) as pool:
        try:
            for done in as_completed([pool.submit(_build_in_worker, spec, region, cache_dir) for region in regions]):
                done.result()
                built()
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()
            if isinstance(error, BrokenProcessPool):
                raise SimulationError(
                    f"map {spec.name}: a process that built its surroundings was killed; is there enough memory? "
                    "Regions that were already built are kept"
                ) from None
            raise


def _set_up_worker() -> None:
    """Set up a worker process: it ignores Ctrl-C, which the parent handles, and ends on SIGTERM or with the parent."""
    gc.disable()  # arrays and polygons form no reference cycles, and searching for them takes an eighth of the time
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise SystemExit(_ENDED)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker has a parent"
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)


def _build_in_worker(spec: MapSpec, region: Region, cache_dir: Path | None) -> None:
    """Build one region in a worker: SIGTERM cleans up temporary files first if there may be any, else ends at once."""
    try:
        signal.signal(signal.SIGTERM, _end)
        _build(spec, region, cache_dir)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    except SystemExit:
        os._exit(_ENDED)  # the pool would continue with the next region


def _build(spec: MapSpec, region: Region, cache_dir: Path | None) -> None:
    """Build one region in the current process."""
    try:
        _cache(spec, cache_dir).region(region)
    except Exception as error:
        error.add_note(f"while building region {region.column}_{region.row} of map {spec.path or spec.name}")
        raise


@lru_cache(maxsize=1)
def _cache(spec: MapSpec, cache_dir: Path | None) -> StaticCache:
    return StaticCache(spec, load_network(spec, cache_dir), cache_dir)
