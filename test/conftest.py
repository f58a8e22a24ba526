"""Its presence lets every test import the modules that lie next to it."""
