"""Interactive pictures of scenes in Rerun: what is shown, where it is laid out, and how it is served to a browser."""

import os

os.environ.setdefault("RUST_LOG", "off")  # Rerun reads it when it is imported; what concerns users is raised here
