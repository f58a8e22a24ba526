"""Pedestrian behavior beyond SUMO: itineraries, jaywalking, plaza visits, avoidance of vehicles and obstacles."""
