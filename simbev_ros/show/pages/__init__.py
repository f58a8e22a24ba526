"""Pages to browse in a web browser: a dataset with its scenes, and the sheet of scenes drawn but not simulated."""
