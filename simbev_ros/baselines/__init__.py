"""Trained baselines for bird's-eye-view segmentation and 3D detection: camera, lidar and fused models.

``frames`` and ``grid`` define what all of them share, ``model`` the networks (torch), ``cache`` the data that training
reads, ``training`` how weights are made from it, ``inference`` how ONNX Runtime answers a frame with them, and ``node``
the stack that answers a live graph. Only ``model`` and ``training`` import torch.
"""
