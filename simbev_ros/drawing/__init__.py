"""Data as pictures and displays, for every viewer."""
