"""Driving a car along a path with a tracker, and what came of it."""
