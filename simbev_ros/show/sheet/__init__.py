"""Contact sheets and videos of recorded scenes, drawn from a scene's bag."""

from typing import Literal

LabelPlacement = Literal["off", "panel", "cameras"]
"""Where labels are drawn.

``off``: nowhere. ``panel``: over a second picture of the main camera, and over the views from above. ``cameras``: over
all cameras, and over the views from above.
"""
