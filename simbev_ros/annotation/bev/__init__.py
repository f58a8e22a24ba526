"""Bird's-eye-view grids: exact rasterization of what lies on the ego's level."""
