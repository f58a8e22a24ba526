"""Ray casting against the static world and moving actors, with Embree. The only package that imports Open3D."""
