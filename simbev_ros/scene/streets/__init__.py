"""Where vehicles can drive and pedestrians can walk: graphs over the lanes of a map."""
