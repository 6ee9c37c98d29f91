"""Logs as loggers write them: formats, channels, units, and the map that makes a recording."""
