"""Broken sensors show what their kind says, while they are broken and only then."""

import math

import numpy as np
import pytest

from models.faults import KINDS, SensorFault


def fault(kind, **times):
    return SensorFault(
        channel="v_y", kind=kind, **{"start": 2.0, "duration": 1.5, **times}, size=0.5
    )


def test_a_fault_lasts_from_its_start_to_its_end():
    t = np.arange(0.0, 6.0, 0.25)
    np.testing.assert_array_equal(fault("zero").active(t), (t >= 2.0) & (t < 3.5))
    np.testing.assert_array_equal(fault("zero", duration=math.inf).active(t), t >= 2.0)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("stuck", 7.0), ("zero", 0.0), ("flipped", -3.0), ("scaled", 1.5), ("biased", 3.5),
        ("drifting", 3.25), ("noisy", 4.0),
    ],
)  # fmt: skip
def test_each_kind_shows_what_it_says(kind, expected):
    """Half a second into the fault a good sensor shows 3, it began at 7, the noise is 2."""
    assert fault(kind).measured(2.5, 3.0, 7.0, 2.0) == pytest.approx(expected)


def test_a_lost_channel_shows_no_number():
    assert np.isnan(fault("lost").measured(2.5, 3.0, 7.0, 2.0))


def test_spikes_are_single_samples():
    t = 2.0 + 0.01 * np.arange(150)
    beside = fault("spiking").measured(t, 3.0, 7.0, 0.0) - 3.0
    hit = np.flatnonzero(beside)
    assert set(beside[hit]) == {0.5}
    assert hit.size == 12
    assert (np.diff(hit) == 13).all()


def test_a_fault_says_in_words_what_it_is():
    said = {str(fault(kind)) for kind in KINDS}
    assert len(said) == len(KINDS)
    assert "v_y biased 0.5 from 2 s on for 1.5 s" in said
    assert str(fault("zero", duration=math.inf)) == "v_y zero from 2 s on"
