"""Statements in an order in which few numbers wait."""

import numpy as np

from codegen.order import in_order


def waiting(needs, order):
    """The largest number of units that are still to be read."""
    unread = {unit: sum(unit in needed for needed in needs.values()) for unit in needs}
    alive, most = set(), 0
    for unit in order:
        for one in needs[unit]:
            unread[one] -= 1
        alive = {one for one in (*alive, unit) if unread[one]}
        most = max(most, len(alive))
    return most


def test_each_unit_is_written_once_and_after_what_it_needs(rng):
    for _ in range(50):
        needs = {k: [int(i) for i in np.flatnonzero(rng.random(k) < 0.1)] for k in range(60)}
        read = {one for needed in needs.values() for one in needed}
        order = in_order(needs, [k for k in needs if k not in read])
        assert sorted(order) == list(needs)
        at = {unit: place for place, unit in enumerate(order)}
        assert all(at[one] < at[unit] for unit, needed in needs.items() for one in needed)


def test_partial_sums_are_read_as_they_come_and_do_not_wait():
    needs, n = {"s0": []}, 30
    for k in range(1, n):
        needs |= {f"s{k}": [f"s{k - 1}"], f"r{k}": [f"s{k - 1}"]}
    results = [f"r{k}" for k in reversed(range(1, n))] + [f"e{n}"]
    needs[f"e{n}"] = [f"s{n - 1}"]
    assert waiting(needs, in_order(needs, results)) < 4
