"""Imports Lanelet2 maps, as the Lanelet2 project and Autoware write them."""
