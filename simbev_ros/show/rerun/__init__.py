"""Rerun's viewer: draws recorded scenes and running graphs, and serves the viewer's page.

Needs the extra ``view``. Coordinates follow the scene's frames; Rerun's entities are named by ``scene_log``.
"""

import os

os.environ.setdefault("RUST_LOG", "off")  # Rerun reads it when it is imported; its log is about its own connections
