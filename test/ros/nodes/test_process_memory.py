"""Loaded objects are excluded from garbage collection, and the kinds of nodes with large buffers keep freed memory."""

import subprocess
import sys

from simbev_ros.ros.nodes.main import KINDS, node_class

FREEZING = """
import gc
from simbev_ros.foundation.process_memory import freeze_after_loading
for _ in range(2):
    with freeze_after_loading():
        assert gc.get_freeze_count() == 0
        loaded = [[number] for number in range(100_000)]
    assert gc.get_freeze_count() > len(loaded)
"""
"""A program of its own: the policy of the tests' process is that of ``conftest.py``."""


def test_objects_loaded_in_the_block_are_frozen_and_a_second_block_freezes_them_again() -> None:
    subprocess.run([sys.executable, "-c", FREEZING], check=True)


def test_nodes_that_handle_images_clouds_or_bags_keep_freed_memory() -> None:
    assert {kind for kind in KINDS if node_class(kind).reuses_large_buffers} == {
        *("camera", "lidar", "annotator", "recorder")
    }
