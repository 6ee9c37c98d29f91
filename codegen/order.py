"""In which order statements are written, so that few numbers wait at a time.

A compiler keeps straight-line code nearly in the order in which it is written, and has few
registers: a number that is needed much later goes to the stack and back. So what a result needs is
written depth first, and whatever frees as many numbers as it makes is written at once.
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

Unit = TypeVar("Unit")


def in_order(needs: Mapping[Unit, Sequence[Unit]], results: Sequence[Unit]) -> list[Unit]:
    """Return the units, each after those that it needs.

    Parameters
    ----------
    needs : of each unit that is written, which others, each once; there is no circle.
    results : units that nobody needs, in the order in which they are wanted.
    """
    readers: dict[Unit, list[Unit]] = {unit: [] for unit in needs}
    for unit, needed in needs.items():
        for one in needed:
            readers[one].append(unit)
    ends = set(results)
    unread = {unit: len(listed) for unit, listed in readers.items()}
    missing = {unit: len(needed) for unit, needed in needs.items()}
    order: dict[Unit, None] = {}

    def is_free(unit: Unit) -> bool:
        made = unit not in ends
        return missing[unit] == 0 and made <= sum(unread[one] == 1 for one in needs[unit])

    def write(first: Unit) -> None:
        waiting = [first]
        while waiting:
            unit = waiting.pop()
            if unit in order:
                continue
            order[unit] = None
            for one in needs[unit]:
                unread[one] -= 1
            for one in readers[unit]:
                missing[one] -= 1
            near = dict.fromkeys(r for one in (unit, *needs[unit]) for r in readers[one])
            waiting += reversed([one for one in near if one not in order and is_free(one)])

    for result in results:
        wanted = [result]
        while wanted:
            absent = [one for one in needs[wanted[-1]] if one not in order]
            if absent:
                wanted += reversed(absent)
            else:
                write(wanted.pop())
    return list(order)
