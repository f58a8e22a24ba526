"""Reads and writes the predictions of a perception stack: files, bags and messages."""
