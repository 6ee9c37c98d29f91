"""The compiled step from sample to sample against the same rules in plain Python, bit by bit."""

import math

import numpy as np
import pytest

from models.recordings.rolled import (
    ALIKE,
    BRAKED,
    MEMORY,
    NOISE,
    PATIENCE,
    ROLLS_OUT,
    SLIP,
    SLOW,
    UNSURE,
    _trust_scan,
)

DT, MOST, LIMIT = 0.01, 12.0, 13.0


def by_hand(state, row, rates, dt, most, limit, free):
    """The speed at the next sample, wheel by wheel in Python: of [v, a, untrusted, known]."""
    v, a, since, known = state
    ahead = v + a * dt
    near, alike = (NOISE + share * abs(ahead) for share in (SLIP, ALIKE))
    doubt = UNSURE * most * since
    steady = [abs(rate) <= limit for rate in rates]
    if max(row) - min(row) <= near and all(steady):
        doubt *= 1.0 + since / PATIENCE
    if max(abs(ahead), *map(abs, row)) < SLOW:
        doubt, steady = SLOW, [True] * len(row)
    likely = [k for k, c in enumerate(row) if steady[k] and abs(c - ahead) <= near + doubt]
    if not likely:
        if all((c - ahead) * a < 0.0 for c in row):
            return (v, 0.0, since + dt, known)  # what it went on by leads away from all
        return (ahead, a, since + dt, known)
    if a > BRAKED:  # driven wheels run ahead of the car, however little
        likely = [k for k in likely if free[k]] or likely
    likely = [k for k in likely if abs(rates[k] - a) <= UNSURE * most] or likely
    speeds = [row[k] for k in likely]
    if a > ROLLS_OUT:
        best = min(speeds)
    elif a < BRAKED:
        best = max(speeds)
    else:
        best = min(speeds, key=lambda c: abs(c - ahead))
    kept = [k for k in likely if abs(row[k] - best) <= alike]
    reach = most * dt + doubt
    now = min(max(sum(row[k] for k in kept) / len(kept), ahead - reach), ahead + reach)
    passed = since + dt
    slope = (now - known) / passed
    if since > MEMORY:  # what was trusted before says little of how it goes on
        slope = sum(rates[k] for k in kept) / len(kept)
    slope = min(max(slope, -most), most)
    a += (1.0 - math.exp(-passed / MEMORY)) * (slope - a)
    return (now, a, 0.0, now)


def drive(rng, k, n=3000):
    """Wheels of a car that speeds up, brakes, stops and rolls, of which some slip now and then."""
    v = np.abs(np.cumsum(rng.normal(0.0, 0.08, n)) + rng.uniform(0.0, 20.0))
    rows = v[:, None] + rng.choice([0.0, 0.01, 0.05]) * rng.standard_normal((n, k))
    for _ in range(8):
        begin, wheel = rng.integers(0, n - 200), rng.integers(0, k)
        lasts, size = rng.integers(5, 200), rng.uniform(-0.5, 0.5)
        rows[begin : begin + lasts, wheel] *= 1.0 + size
    before = rows[np.maximum(np.arange(n) - 5, 0)]
    return rows, (rows - before) / (5.0 * DT)


@pytest.mark.sweep("0-2", "2-4", "3-5", "5-2")
@pytest.mark.parametrize("k", [1, 2, 4, 5])
@pytest.mark.parametrize("seed", range(6))
def test_every_sample_has_the_bits_of_plain_python(k, seed):
    rng = np.random.default_rng(seed)
    rows, rates = drive(rng, k)
    free = rng.random(k) < rng.choice([0.0, 0.5, 1.0])
    state = (float(rows[0, 0]), 0.0, 0.0, float(rows[0, 0]))
    record = _trust_scan(k)(
        len(rows),
        {
            "trust": np.array(state), "row": rows, "rates": rates,
            "rule": np.array([DT, MOST, LIMIT]), "free": free.astype(float),
        },
    )  # fmt: skip
    untrusted = 0
    for n, (row, rate) in enumerate(zip(rows.tolist(), rates.tolist(), strict=True)):
        state = by_hand(state, row, rate, DT, MOST, LIMIT, free.tolist())
        untrusted += state[2] > 0.0
        assert tuple(record["trust_all"][n + 1]) == state, n
    assert (record["untrusted"] > 0.0).sum() == untrusted
    if seed == 0 and k in (1, 2):
        assert 0 < untrusted < len(rows), "both branches are taken"
