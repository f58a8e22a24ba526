"""Predictions of a perception stack: reading them from files, bags and messages, checking them, and writing them."""
