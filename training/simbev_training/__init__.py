"""Training of the baselines, a distribution of its own that adds the verbs ``train`` and ``predict`` to ``simbev``.

``cache`` holds the data that training reads, ``model`` the networks, ``training`` makes their weights and exports them,
and ``predict`` writes their predictions for a dataset. Only ``model`` and ``training`` import torch. Inference, the
node and the weights of the package are in ``simbev_ros.baselines``.
"""
