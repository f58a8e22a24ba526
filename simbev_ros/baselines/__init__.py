"""Trained baselines for bird's-eye-view segmentation and 3D detection: camera, lidar and fused models.

``frames``, ``grid`` and ``boxes`` define what training and the live stack share, ``inference`` answers a frame on ONNX
Runtime, ``weights`` come with the package, and ``node`` is the stack that answers a live graph. Training is a
distribution of its own, ``training/simbev_training``.
"""

from simbev_ros.foundation.installation.shell_variables import prepare_node

prepare_node()
