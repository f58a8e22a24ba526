"""Ground-truth labels: BEV grids, 3D boxes, occupancy, vector maps and visibility, from world state and meshes."""
