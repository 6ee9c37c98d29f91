"""The distribution of benchmarks/rivals: `make` installs it, another environment may lack it."""

import pytest

from identifier.methods import RIVALS, methods

REASON = "needs the rivals: pip install ./benchmarks/rivals"
INSTALLED = set(RIVALS) <= set(methods())
needs_rivals = pytest.mark.skipif(not INSTALLED, reason=REASON)


def rival(name, *values):
    """A case of a parametrized test that is left out where the rivals are not installed."""
    return pytest.param(name, *values, marks=needs_rivals)
