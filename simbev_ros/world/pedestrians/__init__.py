"""How pedestrians walk: itineraries, jaywalking, visits to plazas, and keeping clear of vehicles and obstacles."""
