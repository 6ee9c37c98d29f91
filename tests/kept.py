"""What several tests need one by one: each entry is made when a test asks for it, and kept.

A worker of the tests has a share of them, and makes no entry that no test of its share reads.
"""

from collections.abc import Mapping


class Kept(Mapping):
    """Entries by key; `make` returns the one of a key, once."""

    def __init__(self, keys, make):
        self._keys, self._make, self._made = tuple(keys), make, {}

    def __getitem__(self, key):
        if key not in self._keys:
            raise KeyError(key)
        if key not in self._made:
            self._made[key] = self._make(key)
        return self._made[key]

    def __iter__(self):
        return iter(self._keys)

    def __len__(self):
        return len(self._keys)
