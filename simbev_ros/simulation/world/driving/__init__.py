"""Driver behavior beyond SUMO: predicting conflicts and braking, moving aside, slowing in rain; drivers outside."""
