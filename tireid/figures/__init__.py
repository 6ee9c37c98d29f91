"""Figures worth putting in a paper: functions of results that return a matplotlib Figure."""
