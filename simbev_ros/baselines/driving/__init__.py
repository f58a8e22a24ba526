"""Drivers to compare with: ``python -m simbev_ros.baselines.driving truth``, or ``drive.stack`` in a configuration."""
