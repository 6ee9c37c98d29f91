"""What several tests need one by one: each entry is made when a test asks for it, and kept.

A worker of the tests has a share of them, and makes no entry that no test of its share reads.
"""


class Kept(dict):
    """Entries by key; `make` returns the one of a key, once."""

    def __init__(self, make):
        super().__init__()
        self.make = make

    def __missing__(self, key):
        self[key] = self.make(key)
        return self[key]
