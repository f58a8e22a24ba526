"""The roads as they lie on the ground: strips, levels, heights, surfaces, paint, signs."""
