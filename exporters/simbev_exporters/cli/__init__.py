"""The commands ``simbev export nuscenes`` and ``simbev export opv2v``."""
