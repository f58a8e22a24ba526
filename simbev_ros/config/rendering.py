"""How pictures are drawn."""

from typing import Literal, get_args

Quality = Literal["low", "medium", "high"]
QUALITIES: tuple[Quality, ...] = get_args(Quality)
"""From fast to beautiful. Labels, depth and flow are the same in all."""
