"""Rigid bodies in smooth motion: points that move on lanes in, poses on the ground without jumps out."""
