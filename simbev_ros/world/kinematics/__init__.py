"""Rigid bodies in smooth motion: from points that move on lanes to poses on the ground that never jump."""
