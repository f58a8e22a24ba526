"""Reads predictions of a perception stack from files, bags and messages, checks them, and writes them."""
