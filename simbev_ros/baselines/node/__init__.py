"""The stack that answers a live graph with a trained baseline: ``python -m simbev_ros.baselines.node lidar``.

It knows the graph by its topics alone. ``scene_inputs`` says what a scene sends, ``sweeps`` keeps earlier clouds,
``image_fit`` and ``view`` bring images to the model's size, ``answering`` turns a frame into boxes and scores, and
the package's ``tracker`` names boxes over time. ``node`` connects these to ROS.
"""
