"""Faults that a program plants, and whether the tests catch them."""
