"""The base of all errors that say what is wrong with a log, a car, a method or a file."""


class TireidError(Exception):
    """Base of the errors of tireid; each is also of the builtin of its meaning, as ValueError."""
