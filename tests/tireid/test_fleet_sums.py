"""A fleet's arithmetic by another road: rows that are made, sums and tests written out again."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from identifier.estimate.fit import fit
from identifier.estimate.information import CHANGES, GRID, PLACE, SIZE, Information, coordinates
from identifier.estimate.priors import SENSORS, Priors
from identifier.estimate.solve import settled
from identifier.frozen import vehicle_numbers
from identifier.motion.parameters import INDEX
from models.recordings import read_recording
from models.vehicle import sedan
from tireid.fleet.learn import DT, learn_recording
from tireid.fleet.merge import APART, errors_of, merge, usable
from tireid.fleet.store import OBSERVABLE, LogRow, Store, StoreError, information_columns
from tireid.fleet.watch import LARGEST, USUAL, watch

for name in ("pyarrow", "fsspec"):
    pytest.importorskip(name, reason="needs a store")

CAR = replace(sedan(), chassis=None)
Q = len(OBSERVABLE)
SCALES = np.append(np.full(20, 0.05), np.full(Q - 20, 0.02))  # of u that a residual of 1 is worth


def told_of(p, rng, *, seconds=60.0, noise=0.0):
    """Information of random residuals, linear in u, of parameters (p,)."""
    u, _ = coordinates(p)
    J = rng.normal(size=(200, Q)) / SCALES / 4.0
    y = J @ u[OBSERVABLE] + noise * rng.normal(size=200)
    matrix, vector = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
    matrix[np.ix_(OBSERVABLE, OBSERVABLE)] = 0.5 * (J.T @ J + (J.T @ J).T)
    vector[OBSERVABLE] = J.T @ y
    return Information(matrix=matrix, vector=vector, seconds=seconds)


def tires(front=1.0, rear=1.0, friction=1.0, car=CAR):
    """Parameters of tires stiffer than those of the prior, or on another road."""
    p = Priors.of(car).mean.copy()
    p[INDEX["ln_stiffness_f"]] += np.log(front)
    p[INDEX["ln_stiffness_r"]] += np.log(rear)
    for axle in "fr":
        p[INDEX[f"ln_grip_{axle}"]] += np.log(friction)
    return p


def merged(rows, by=()):
    return merge(lambda: iter(rows), by)


def row_of(k, told, *, car=CAR, **more):
    row = LogRow(
        log=f"{k:03d}",
        content=f"{k:032x}",
        setting="told",
        vehicle=car.name,
        tires="new",
        date=f"2026-{k // 28 + 1:02d}-{k % 28 + 1:02d}",
        tags='{"driver": "ann"}',
        car=json.dumps(vehicle_numbers(car)),
        reach=[0.01 * k, 0.1, 10.0 - k, 20.0, -1.0, 0.1 * k, 0.3, 0.2],
        **information_columns(told),
    )
    return replace(row, **more)


def test_what_a_log_tells_comes_back_from_a_store(tmp_path):
    told = told_of(tires(), np.random.default_rng(1))
    store = Store(str(tmp_path / "store"))
    store.write([row_of(0, told)])
    (row,) = store.stream()
    assert row == replace(row_of(0, told), findings=[]) and len(row.matrix) == Q * (Q + 1) // 2
    back, reach = row.learnt()
    assert (back.matrix == told.matrix).all() and (back.vector == told.vector).all()
    assert back.seconds == told.seconds and reach.ravel().tolist() == row.reach


def test_a_merged_model_is_the_optimum_of_prior_and_logs():
    rng = np.random.default_rng(3)
    parts = [told_of(tires(1.1, 0.9), rng, noise=1.0) for _ in range(6)]
    rows = [row_of(k, one) for k, one in enumerate(parts)]
    (one,) = merged(rows, ["vehicle", "month", "driver"])
    assert one.key == (("vehicle", CAR.name), ("month", "2026-01"), ("driver", "ann"))
    assert (one.name, one.logs, one.elsewhere) == (f"{CAR.name} 2026-01 ann", 6, 0)
    assert merged(rows)[0].name == "all"
    beliefs, model = Priors.of(CAR), one.model
    sd = errors_of(beliefs)
    np.testing.assert_allclose(sd, APART * beliefs.sd[[INDEX[name] for name in CHANGES]])
    along = np.zeros((SIZE, len(CHANGES)))
    along[[PLACE[name] for name in CHANGES], range(len(CHANGES))] = 1.0

    def cost(p):
        """Over each log's own errors of sensors, the least."""
        u, _ = coordinates(p)
        total = 0.5 * (p - beliefs.mean) @ beliefs.information @ (p - beliefs.mean)
        for part in parts:
            H = along.T @ part.matrix @ along + np.diag(sd**-2.0)
            d = -np.linalg.solve(H, along.T @ (part.matrix @ u - part.vector))
            v = u + along @ d
            total += 0.5 * v @ part.matrix @ v - part.vector @ v + 0.5 * np.sum((d / sd) ** 2)
        return total

    least = cost(model.p)
    for k in np.flatnonzero(beliefs.moves):
        step = np.zeros(model.p.size)
        step[k] = 0.3 * np.sqrt(model.covariance[k, k])
        for p in (model.p + step, model.p - step):
            if beliefs.low[k] <= p[k] <= beliefs.high[k]:
                assert cost(p) > least - 1e-3
    assert model["ln_stiffness_f"] == pytest.approx(tires(1.1)[INDEX["ln_stiffness_f"]], abs=0.1)
    k = INDEX["v_y_bias"]
    assert model.covariance[k, k] > sd[CHANGES.index("v_y_bias")] ** 2  # of the next log
    assert model.reach.slip.tolist() == [0.05, 0.1] and model.reach.speeds.tolist() == [5.0, 20.0]
    assert model.reach.a_x.tolist() == [-1.0, 0.5] and one.information.seconds == 360.0


def test_merged_rows_are_the_fit_of_all_logs_at_once(logs):
    drives = [read_recording(logs / f"{name}.csv", dt=DT) for name in ("slalom", "quick")]
    rows = [
        learn_recording(LogRow(log=str(k), content=str(k)), one, CAR)
        for k, one in enumerate(drives)
    ]
    (together,) = merged(rows)
    at_once = fit(drives, CAR, coarse=True).model
    reached = np.minimum(together.model.reach.slip, at_once.reach.slip)
    slips = np.linspace(0.2, 1.0, 5)[:, None] * reached
    curves = [one.force(slips) for one in (together.model, at_once)]
    assert curves[0] == pytest.approx(curves[1], rel=0.03)
    alone = merged(rows[:1])[0].model
    assert (
        np.diag(together.model.covariance)[INDEX["ln_stiffness_f"]]
        < (np.diag(alone.covariance)[INDEX["ln_stiffness_f"]])
    )


def test_a_log_of_a_wet_road_does_not_lower_the_grip_of_the_others():
    rng = np.random.default_rng(7)
    dry = [row_of(k, told_of(tires(), rng, noise=1.0)) for k in range(4)]
    wet = row_of(4, told_of(tires(friction=0.5), rng, noise=1.0))
    (alone,), (both,) = merged(dry), merged([*dry, wet])
    assert (alone.elsewhere, both.elsewhere, both.logs) == (0, 1, 5)
    far = GRID.index(0.19)
    alone, both = (coordinates(one.model.p)[0][far] for one in (alone, both))
    assert both == pytest.approx(alone, rel=0.03)
    told = sum((row.learnt()[0] for row in [*dry, wet]), Information.nothing())
    together = coordinates(settled(Priors.of(CAR).after(told), tires())[0])[0][far]
    assert together < 0.95 * alone


def test_rows_are_grouped_by_what_they_say_and_a_log_counts_once():
    told = told_of(tires(), np.random.default_rng(4))
    rows = [row_of(k, told) for k in range(40)]
    names = ("log", "week", "month", "tires", "setting")
    assert [len(merged(rows, [name])) for name in names] == [40, 7, 2, 1, 1]
    (year_end,) = merged([row_of(0, told, date="2024-12-30T10:00")], ["week", "date"])
    assert year_end.key == (("week", "2025-W01"), ("date", "2024-12-30T10:00"))
    for again in (replace(rows[3], setting="other"), replace(rows[3], content="other")):
        with pytest.raises(StoreError, match=r"^003 would count twice, by told/0.*3.parquet and "):
            merged([*rows, again])
    with pytest.raises(StoreError, match=r"^copy would count twice"):
        merged([*rows, replace(rows[3], log="copy", setting="other")])
    assert len(merged([*rows, replace(rows[3], setting="other")], ["setting"])) == 2
    assert merged([*rows, replace(rows[3], run="2")])[0].logs == 41
    other = row_of(50, told, car=replace(CAR, mass=1600.0))
    for ask in (merged, lambda rows: watch(rows, [])):
        with pytest.raises(StoreError, match=r"^000 and 050 are of cars whose files differ"):
            ask([*rows, other])
    with pytest.raises(StoreError, match="must begin with year-month-day"):
        merged([replace(rows[0], date="yesterday")], ["week"])


def test_a_row_is_used_where_it_tells_something_that_is_not_rejected():
    good = row_of(0, told_of(tires(), np.random.default_rng(0)))
    for row, used, all_ in (
        (good, True, True),
        (replace(good, valid=True), True, True),
        (replace(good, valid=False), False, True),
        (replace(good, error="no"), False, False),
        (replace(good, driven=None), False, False),
    ):
        assert (usable(row), usable(row, rejected=True)) == (used, all_)


# Watching.


def drawn(seed, changes, *, cars=1, first=5):
    """Rows of cars, some logs a day: `first` days as ever, then days with changes of the tires.

    changes : factors of stiffness front and rear and of friction, a day each, of the last car.
    """
    rng, rows = np.random.default_rng(seed), []
    for car in range(cars):
        for day in range(first + len(changes)):
            change = changes[day - first] if day >= first and car == cars - 1 else (1.0, 1.0, 1.0)
            today = np.array(change) * np.exp(rng.normal(scale=(0.01, 0.01, 0.03)))
            for _ in range(2):
                told = told_of(tires(*today), rng, noise=1.0, seconds=300.0)
                k = len(rows)
                date = f"2026-{day // 28 + 1:02d}-{day % 28 + 1:02d}"
                rows.append(row_of(k, told, vehicle=f"car {car}", date=date))
    return [rows[k] for k in rng.permutation(len(rows))]


SAME = (1.0, 1.0, 1.0)


@pytest.mark.parametrize("seed", range(8))
def test_tires_that_stay_are_silent_and_a_fifth_less_rings_from_its_day_on(seed):
    days, short = watch(drawn(seed, [SAME] * 6 + [(0.8, 1.0, 1.0)] * 4, cars=2), ["vehicle"])
    assert short == [] and len(days) == 2 * 13  # two days of 600 s are the reference
    assert [(day.car, day.day) for day in days if day.alarm] == [
        ("car 1", f"2026-01-{day}") for day in range(12, 16)
    ]
    for day in days[-4:]:
        assert day.change[0] == pytest.approx(math.log(0.8), abs=3.0 * day.sd[0]) and day.p < 1e-4
        assert "car 1, 2026-01-1" in day.line and " stiffness front -" in day.line


def test_a_slow_loss_rings_once_it_is_large_enough_and_a_change_that_ends_falls_silent():
    slow = [(1.0, 1.0 - 0.006 * k, 1.0) for k in range(40)]
    ringing = [day.alarm for day in watch(drawn(1, slow), ["vehicle"])[0]]
    assert not any(ringing[:8]) and all(ringing[-8:])
    days, _ = watch(drawn(2, [SAME, (1.0, 1.0, 0.4), SAME, SAME]), ["vehicle"])
    assert [day.alarm for day in days[-4:]] == [False, True, False, False]


def test_the_number_of_a_day_is_the_chi_square_of_its_estimate():
    rows = drawn(3, [(0.93, 1.02, 1.0)], first=3)
    by_day = sorted(rows, key=lambda row: row.date)
    (*_, day), _ = watch(rows, ["vehicle"])
    beliefs = Priors.of(CAR)
    sums = [Information.nothing(), Information.nothing(), Information.nothing()]
    for row in by_day:
        at = 0 if row.date <= "2026-01-02" else 1 if row.date == "2026-01-03" else 2
        sums[at] += row.learnt()[0].of_one_day(errors_of(beliefs))
    p, _ = settled(beliefs.after(sums[0]), beliefs.mean)
    free = [INDEX[name] for name in ("ln_stiffness_f", "ln_stiffness_r", "ln_road", *SENSORS)]
    sd = [LARGEST] * 3 + [beliefs.sd[INDEX[name]] for name in SENSORS]
    u, slopes = coordinates(p)
    found = []
    for one in sums:  # by least squares over rows of a root of the information
        root = np.linalg.cholesky(one.matrix[np.ix_(OBSERVABLE, OBSERVABLE)]).T
        y = np.linalg.solve(root.T, (one.vector - one.matrix @ u)[OBSERVABLE])
        A = np.vstack([root @ slopes[np.ix_(OBSERVABLE, free)], np.diag(1.0 / np.array(sd))])
        z = np.linalg.lstsq(A, np.append(y, np.zeros(len(free))), rcond=None)[0]
        found.append((z[:3], np.linalg.inv(A.T @ A)[:3, :3]))
    known = np.diag(found[1][1] + found[2][1]) / 2.0
    step = np.maximum((found[2][0] - found[1][0]) ** 2 / 0.455 / 2.0 - known, 0.0)
    T = np.diag((10.0 * USUAL**2 + step) / 11.0)
    S = found[2][1] + found[0][1] + T + T / 2.0
    assert np.array(day.change) == pytest.approx(found[2][0], abs=1e-6)
    assert np.array(day.sd) == pytest.approx(np.sqrt(np.diag(S)), rel=1e-5)
    x2 = found[2][0] @ np.linalg.inv(S) @ found[2][0]
    assert (day.chi_square, day.seconds) == (pytest.approx(x2, rel=1e-4), 600.0)
    x = np.linspace(0.0, math.sqrt(x2), 20001)  # the norm of three normal numbers
    inside = np.trapezoid(np.sqrt(2.0 / np.pi) * x**2 * np.exp(-(x**2) / 2.0), x)
    assert day.p == pytest.approx(1.0 - inside, rel=1e-3, abs=1e-9)


def test_a_day_of_seconds_and_a_car_within_its_reference_are_not_judged():
    rng = np.random.default_rng(0)
    rows = [row_of(k, told_of(tires(), rng, seconds=700.0), vehicle="a") for k in range(3)]
    rows.append(row_of(3, told_of(tires(0.5), rng, seconds=30.0), vehicle="a"))
    rows.append(row_of(4, told_of(tires(), rng, seconds=700.0), vehicle="b"))
    days, short = watch(rows, ["vehicle"])
    assert [(day.car, day.day) for day in days] == [("a", "2026-01-03")] and short == ["b"]
