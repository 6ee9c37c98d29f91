"""Logs as loggers write them: formats, channels, units, and the map that makes a recording.

What cannot be read is refused by a `RecordingError` of one line: file, place, rule, remedy.
"""
