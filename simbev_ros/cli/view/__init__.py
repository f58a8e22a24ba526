"""``simbev view``: shows a recorded scene, or a running graph, in Rerun's viewer, Foxglove or Lichtblick."""
