"""Exporters of simbev_ros's datasets to the layouts of other projects; ``simbev export`` finds them by entry points."""
