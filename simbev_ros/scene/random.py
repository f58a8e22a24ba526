"""Random streams, as scenes use them; they are defined below maps and scenes because maps are drawn too."""

from simbev_ros.random import stream

__all__ = ["stream"]
