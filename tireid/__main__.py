"""`python -m tireid`: the command line."""

from tireid.cli import entry

entry()
