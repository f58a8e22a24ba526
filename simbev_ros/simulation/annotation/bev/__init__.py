"""Bird's-eye-view ground truth: exact rasterization of everything on the ego's road level."""
