"""Recordings of real sensors in the layouts of KITTI and nuScenes, or in a folder, as frames that baselines answer.

``kitti``, ``nuscenes`` and ``folder`` read a layout, ``recording`` is what they have in common, ``clouds`` reads files
of points, ``ground`` finds the ground, and ``model_inputs`` makes what a model sees of a frame.
"""
