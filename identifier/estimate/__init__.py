"""Tires, sensors and body from whole logs, by one estimate."""
