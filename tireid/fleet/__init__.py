"""Thousands of logs: learnt, stored, merged, watched over. `tireid fleet` calls what lies here."""
