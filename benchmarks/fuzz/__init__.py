"""Hostile files and words at every door of the commands: python -m benchmarks.fuzz."""
