"""Times the driver of a dataset's production, with workers that only copy a recorded scene."""
