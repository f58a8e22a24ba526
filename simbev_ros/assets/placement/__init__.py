"""Where things stand in a region: the ground below, claimed footprints, and the tiles that hold the meshes."""
