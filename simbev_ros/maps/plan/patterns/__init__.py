"""The patterns that a town's recipe combines: grids, regions, motorways, viaducts, roundabouts."""
