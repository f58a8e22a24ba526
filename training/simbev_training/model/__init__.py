"""The networks of the baselines, in torch; ``bev_model`` puts them together."""
