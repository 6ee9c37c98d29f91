"""Which designs of a sweep are worth having: the Pareto front of frozen against online error."""

from collections.abc import Sequence

from identifier.cross_replay import Shares
from identifier.sweep import Candidate


def pareto_front(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the designs that none beats both online and frozen, by rising online error.

    The frozen error is that on other recordings, or where learnt if there is only one; designs
    that diverged, and those of methods that cannot be frozen, are never on it.

    Parameters
    ----------
    candidates : of one method.
    """
    front: list[Candidate] = []
    sane = [c for c in candidates if not c.diverged_on and frozen_share(c.shares) is not None]
    for candidate in sorted(sane, key=lambda c: (c.shares.online, frozen_share(c.shares) or 0.0)):
        error = frozen_share(candidate.shares)
        best = frozen_share(front[-1].shares) if front else None
        assert error is not None
        if best is None or error < best:
            front.append(candidate)
    return front


def best_candidate(candidates: Sequence[Candidate]) -> Candidate | None:
    """Return the design with the smallest frozen error, online error where nothing is frozen.

    Parameters
    ----------
    candidates : of one method.

    Returns
    -------
    None where every design diverged.
    """

    def error(candidate: Candidate) -> float:
        frozen = frozen_share(candidate.shares)
        return candidate.shares.online if frozen is None else frozen

    sane = [candidate for candidate in candidates if not candidate.diverged_on]
    return min(sane, key=error, default=None)


def frozen_share(found: Shares) -> float | None:
    """Return the frozen error on other recordings, or where learnt if there is only one [%].

    Parameters
    ----------
    found : of a design.
    """
    return found.in_sample if found.other is None else found.other
