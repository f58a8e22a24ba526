"""Builds meshes of roads: street surfaces, markings, bridges, pillars and guard rails."""
