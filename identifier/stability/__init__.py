"""Stability of the identifier: margins of the learning loop, proven bounds."""
