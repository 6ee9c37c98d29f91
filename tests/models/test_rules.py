"""Rules of numbers and of arguments: one line with the name, the rule and the value."""

import numpy as np
import pytest

from models.rules import require_positive, require_within


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("1500", "'1500'"),
        (b"1500", "b'1500'"),
        (None, "None"),
        (1500 + 0j, r"\(1500\+0j\)"),
        ([1500.0], "a list of 1"),
        (np.zeros(3), "array"),
    ],
)
def test_what_is_no_number_is_refused_by_its_name(value, shown):
    with pytest.raises(ValueError, match=rf"^mass must be a number, it is {shown}"):
        require_positive(ValueError, mass=value)
    with pytest.raises(ValueError, match=rf"^mass must be a number, it is {shown}"):
        require_within(ValueError, 0.0, 1.0, mass=value)


@pytest.mark.parametrize("value", [1, 0.5, np.float32(0.5), np.int64(1), np.array(0.5), True])
def test_every_kind_of_number_is_one(value):
    require_positive(ValueError, mass=value)
    require_within(ValueError, 0.0, 1.0, mass=value)
