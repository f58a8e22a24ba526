"""``simbev train`` and ``simbev predict``: baselines for bird's-eye-view segmentation and 3D detection."""
