"""Interactive pictures of scenes in Rerun: what is shown, where it is laid out, and how it is served to a browser."""
