"""A fleet's arithmetic by another road: rows that are made, sums and tests written out again."""

import json
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.axle.information import TOGETHER, Information, change_from, reference_of, total
from identifier.axle.prior import fiala_weights
from identifier.frozen import vehicle_numbers
from models.vehicle import sedan
from tireid.fleet.merge import MergeError, fleet_prior, key_of, merge, sizes, usable
from tireid.fleet.store import LogRow, Store, information_columns
from tireid.fleet.watch import Alarm, Watching, watch

pyarrow = pytest.importorskip("pyarrow", reason="needs pyarrow and fsspec")
pytest.importorskip("fsspec", reason="needs pyarrow and fsspec")
parquet = pytest.importorskip("pyarrow.parquet")

CAR = replace(sedan(), chassis=None)
DESIGN = AxleIdentifier.for_vehicle(CAR, dt=0.01)
N, Q = len(DESIGN.ladder), len(DESIGN.ladder) + 3


def told_of(theta, rng, *, samples=400, seconds=60.0, noise=0.0):
    """Information of random regressors on parameters (2, q), and its arrays."""
    h = rng.normal(size=(samples, 2, Q)) * np.append(np.ones(N), [0.01, 0.1, 0.01])
    y = np.einsum("kai,ai->ka", h, theta) + noise * rng.normal(size=(samples, 2))
    return Information(
        matrix=np.einsum("kai,kaj->aij", h, h),
        vector=np.einsum("kai,ka->ai", h, y),
        square=(y**2).sum(axis=0),
        samples=float(samples),
        seconds=seconds,
    )


def tires(front=1.0, rear=1.0, friction=1.0):
    """Parameters (2, q) of brush tires over those of the car as it is told."""
    theta = np.zeros((2, Q))
    C = np.array([CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear]) / CAR.axle_loads
    for i, factor in enumerate((front, rear)):
        theta[i, :N] = fiala_weights(C[i] * factor, 0.9 * friction, DESIGN.ladder)
    return theta


def row_of(k, parts, *, car=CAR, **more):
    excitation = np.arange(18.0).reshape(2, 9) + k * np.array([[1.0], [-1.0]])
    row = LogRow(
        log=f"{k:03d}",
        content=f"{k:032x}",
        setting="told",
        vehicle=car.name,
        tires="new",
        date=f"2026-{k // 28 + 1:02d}-{k % 28 + 1:02d}",
        tags='{"driver": "ann"}',
        car=json.dumps(vehicle_numbers(car)),
        excitation=excitation.ravel().tolist(),
        part_begin=[60.0 * i for i in range(len(parts))],
        **information_columns(parts),
    )
    return replace(row, **more)


def test_what_parts_tell_comes_back_from_a_store(tmp_path):
    rng = np.random.default_rng(1)
    parts = [told_of(rng.normal(size=(2, Q)), rng, seconds=s) for s in (60.0, 31.0)]
    store = Store(str(tmp_path / "store"))
    store.keep([row_of(0, parts)])
    store.settle()
    (row,) = store.rows()
    assert (
        row == replace(row_of(0, parts), findings=[])
        and len(row.matrix) == 2 * 2 * Q * (Q + 1) // 2
    )
    path = tmp_path / "store" / "logs" / row.bucket
    table = parquet.read_table(path)
    for name in ("tires", "findings"):  # as another program may leave them
        empty = pyarrow.nulls(1, table.schema.field(name).type)
        table = table.set_column(table.column_names.index(name), name, empty)
    parquet.write_table(table, path)
    assert store.rows() == [replace(row, tires="", findings=())]
    for one, back in zip(parts, row.parts, strict=True):
        for name in ("matrix", "vector", "square"):
            assert (getattr(back, name) == getattr(one, name)).all()
        assert (back.samples, back.seconds) == (one.samples, one.seconds)


def test_logs_are_spread_over_sixteen_files_and_the_runs_of_one_lie_together():
    rows = [row_of(k, []) for k in range(200)]
    assert len({row.bucket for row in rows}) == 16
    for row in rows[:9]:
        others = [replace(row, **more) for more in ({"run": "2"}, {"setting": "x"}, {"log": "y"})]
        assert {one.bucket for one in others} == {row.bucket}
    assert len({replace(row, content="").bucket for row in rows}) == 16


def test_sums_are_exact_in_any_order_and_in_any_portions():
    rng = np.random.default_rng(2)
    some = []
    for _ in range(2 * TOGETHER + 7):
        wide = 10.0 ** rng.uniform(-12, 12, size=(2, Q)) * rng.choice([-1.0, 1.0], size=(2, Q))
        some.append(replace(told_of(np.ones((2, Q)), rng, samples=3), vector=wide))
    exact = np.array(
        [[float(sum(Fraction(one.vector[a, i]) for one in some)) for i in range(Q)] for a in (0, 1)]
    )
    for order in (some, some[::-1], sorted(some, key=lambda one: one.vector[0, 0])):
        told = total(order, Q)
        assert (told.vector == exact).all() and told.samples == 3.0 * len(some)
    assert (told.matrix == total(some, Q).matrix).all() and told.seconds == 60.0 * len(some)
    assert not total([], Q).vector.any()


def test_a_merged_model_solves_the_normal_equations_of_prior_and_logs():
    rng = np.random.default_rng(3)
    parts = [told_of(tires(1.1, 0.9), rng, samples=40, noise=0.1) for _ in range(6)]
    rows = [row_of(k, parts[2 * k : 2 * k + 2]) for k in range(3)]
    (one,) = merge(iter(rows), ["vehicle", "month", "driver"])
    assert one.key == (("vehicle", CAR.name), ("month", "2026-01"), ("driver", "ann"))
    assert (one.name, one.logs) == (f"{CAR.name} 2026-01 ann", 3)
    assert merge(rows, [])[0].name == "all"
    before = reference_of(DESIGN, CAR)
    for i in (0, 1):
        Lambda0 = np.linalg.inv(before.covariance[i])
        mean = np.append(before.W[i], before.own[i])
        Lambda = sum(part.matrix[i] for part in parts)
        eta = sum(part.vector[i] for part in parts)
        theta = np.linalg.solve(Lambda0 + Lambda, Lambda0 @ mean + eta)
        assert np.append(one.model.W[i], one.model.own[i]) == pytest.approx(
            theta, rel=1e-7, abs=1e-9
        )
        assert np.linalg.inv(one.model.covariance[i]) == pytest.approx(
            Lambda0 + Lambda, rel=1e-6, abs=1e-3
        )
    theta = np.hstack([one.model.W, one.model.own])
    squares = sum(
        part.square
        - 2.0 * (theta * part.vector).sum(axis=1)
        + np.einsum("ai,aij,aj->a", theta, part.matrix, theta)
        for part in parts
    )
    assert one.misfit == pytest.approx(squares / 240.0)
    each = np.array([np.reshape(row.excitation, (2, 9)) for row in rows])
    assert (one.model.excitation[:, 0] == each[:, :, 0].max(axis=0)).all()
    assert (one.model.excitation[:, 1:] == each[:, :, 1:].sum(axis=0)).all()
    assert one.told.seconds == 360.0


def test_rows_are_grouped_by_what_they_say_and_a_log_counts_once():
    rng = np.random.default_rng(4)
    rows = [row_of(k, [told_of(tires(), rng)]) for k in range(40)]
    assert [len(merge(rows, [name])) for name in ("log", "week", "month", "tires", "setting")] == [
        40, 7, 2, 1, 1,
    ]  # fmt: skip
    assert key_of(rows[4], ["week", "date"]) == (("week", "2026-W02"), ("date", "2026-01-05"))
    assert key_of(row_of(0, [], date="2024-12-30T10:00"), ["week"]) == (("week", "2025-W01"),)
    again = replace(rows[3], setting="otherwise")
    with pytest.raises(MergeError, match=r"^003 was learnt with two settings, told and otherwise"):
        merge([*rows, again], [])
    assert len(merge([*rows, again], ["setting"])) == 2
    assert merge([*rows, replace(rows[3], run="2")], [])[0].logs == 41
    other = row_of(50, [told_of(tires(), rng)], car=replace(CAR, mass=1600.0))
    for ask in (lambda: merge([*rows, other], []), lambda: watch([*rows, other], [], Watching())):
        with pytest.raises(MergeError, match=r"^000 and 050 are of cars whose files differ"):
            ask()


def test_a_row_is_used_where_it_tells_something_that_is_not_refused():
    good = row_of(0, [told_of(tires(), np.random.default_rng(0))])
    for row, used, all_ in (
        (good, True, True),
        (replace(good, valid=True), True, True),
        (replace(good, valid=False), False, True),
        (replace(good, error="no"), False, False),
        (row_of(0, []), False, False),
    ):
        assert (usable(row), usable(row, refused=True)) == (used, all_)


def test_a_fleets_prior_is_where_expectation_and_maximization_rest():
    rng = np.random.default_rng(5)
    cars = [replace(CAR, name=f"{k}", mass=1400.0 + 50.0 * k, l_f=1.0 + 0.05 * k) for k in range(5)]
    rows = []
    for k, car in enumerate(cars):
        theta = tires(*np.exp(0.1 * rng.normal(size=3)))
        theta[:, N:] = np.abs(rng.normal(size=(2, 3))) * [0.01, 0.1, 0.002]
        rows.append(row_of(k, [told_of(theta, rng, noise=1.0)], car=car))
    groups = merge(rows, ["vehicle"])
    prior = fleet_prior(groups)
    m, T = prior.mean, prior.between
    means, spreads, wide = [], [], []
    for one in groups:
        car = one.model.vehicle
        size = np.ones((2, Q))
        size[:, Q - 3], size[1, Q - 1] = car.wheelbase, math.sqrt(9.81 * car.wheelbase)
        assert sizes(car, Q) == pytest.approx(size, rel=1e-3)
        size = sizes(car, Q)
        before = reference_of(AxleIdentifier.for_vehicle(car, dt=0.01), car)
        for i in (0, 1):
            scale = np.outer(size[i], size[i])
            Lambda, eta = one.told.matrix[i] * scale, one.told.vector[i] * size[i]
            P = np.linalg.inv(np.linalg.inv(T[i]) + Lambda)
            means.append(P @ (np.linalg.solve(T[i], m[i]) + eta))
            spreads.append(P)
            wide.append(before.covariance[i] / scale)
    means = np.reshape(means, (5, 2, Q))
    spreads, wide = np.reshape(spreads, (5, 2, Q, Q)), np.reshape(wide, (5, 2, Q, Q))
    assert m == pytest.approx(means.mean(axis=0), abs=1e-3)
    away = means - m
    rest = (
        2.0 * wide.mean(axis=0) + spreads.sum(axis=0) + np.einsum("vai,vaj->aij", away, away)
    ) / 7.0
    sd = np.sqrt(np.einsum("aii->ai", rest))
    assert np.abs((T - rest) / (sd[:, :, None] * sd[:, None, :])).max() < 0.01
    model = prior.model(cars[0])
    size = sizes(cars[0], Q)
    assert np.hstack([model.W, model.own]) == pytest.approx(m * size, rel=1e-6)
    assert model.covariance == pytest.approx(1.2 * T * size[:, :, None] * size[:, None, :])
    assert (prior.cars, model.vehicle) == (5, cars[0])
    with pytest.raises(MergeError, match="curves are of other units"):
        fleet_prior([groups[0], replace(groups[1], model=replace(
            groups[1].model, ladder=tuple(2.0 * one for one in DESIGN.ladder)))])  # fmt: skip


# Watching: Page's sums written out, part by part.


@pytest.fixture(scope="module")
def driven():
    """Two cars, one of which loses a fifth at the front; a third that has hardly begun."""
    rng = np.random.default_rng(6)
    rows = []
    for name, change in (("a", 0.8), ("b", 1.0)):
        for k in range(60):
            theta = tires(np.exp(0.02 * rng.normal()) * (change if k >= 35 else 1.0))
            parts = [told_of(theta, rng, noise=0.5), told_of(theta, rng, seconds=4.0)]
            rows.append(row_of(k, parts, vehicle=name, content=f"{name}{k}"))
    rows += [row_of(k, [told_of(tires(), rng)], vehicle="c", content=f"c{k}") for k in range(20)]
    return [rows[k] for k in rng.permutation(len(rows))]


def test_the_watch_sums_log_likelihood_ratios_of_page(driven):
    looked = Watching(baseline=1200.0, false_alarms=2.0, stiffness=0.08, friction=0.3)
    seen = watch(iter(driven), ["vehicle"], looked)
    assert list(seen.seen) == ["a", "b"] and seen.short == ("c",)
    statistics = {}
    for name in ("a", "b"):
        rows = sorted((row for row in driven if row.vehicle == name), key=lambda row: row.date)
        told = [row.parts[0] for row in rows]  # the other is shorter than what says anything
        before, base = reference_of(DESIGN, CAR), total(told[:20], Q)
        Lambda0, mean = np.linalg.inv(before.covariance), np.hstack([before.W, before.own])
        eta = np.einsum("aij,aj->ai", Lambda0, mean) + base.vector
        theta = np.linalg.solve(Lambda0 + base.matrix, eta[:, :, None])[:, :, 0]
        changes = [change_from(one, theta, DESIGN, CAR) for one in told]
        z = np.array([[c.value[0, 0], c.value[1, 0], c.value[:, 1].mean()] for c in changes])
        S = np.array([[*c.covariance[:, 0, 0], c.covariance[:, 1, 1].sum() / 4] for c in changes])
        usual = np.median(z[:20], axis=0)
        scatter = (1.4826 * np.median(np.abs(z[:20] - usual), axis=0)) ** 2
        statistics[name] = z[20:] - usual, S[20:], scatter
    fleet = np.median([one[2] for one in statistics.values()], axis=0)
    h = math.log(6.0 * 3.6e6 / 60.0 / 2.0)
    delta = np.array([0.08, 0.08, 0.3])
    for name, (z, S, scatter) in statistics.items():
        T = np.maximum((10.0 * fleet + 20.0 * scatter) / 30.0, np.array([0.01, 0.01, 0.05]) ** 2)
        g, sums = np.zeros((2, 3)), []
        for k in range(len(z)):
            rise = delta * (z[k] - delta / 2.0) / (S[k] + T)
            fall = delta * (-z[k] - delta / 2.0) / (S[k] + T)
            g = np.array([
                [min(h, max(0.0, old + min(max(new, -h / 10.0), h / 10.0)))
                 for old, new in zip(g[way], ratio, strict=True)]
                for way, ratio in enumerate((rise, fall))
            ])  # fmt: skip
            sums.append(g)
        one = seen.seen[name]
        assert one.h == pytest.approx(h) and one.sums == pytest.approx(np.array(sums), abs=1e-6)
        assert one.z == pytest.approx(z, abs=1e-9) and one.variance == pytest.approx(S + T)
        assert (one.driven == 60.0 * np.arange(1, 41)).all()
    assert seen.hours == pytest.approx(2 * 40 / 60)
    (alarm,) = seen.alarms
    one = seen.seen["a"]
    first = int(np.argmax(one.sums[:, 1, 0] >= one.h * (1.0 - 1e-12)))
    begun = int(np.flatnonzero(one.sums[: first + 1, 1, 0] <= 0.0)[-1]) + 1
    assert (alarm.car, alarm.statistic, alarm.ended) == ("a", 0, "")
    assert alarm.log == one.parts[first].log and alarm.date == one.parts[first].date
    assert alarm.began == one.parts[begun].log and alarm.after == 60.0 * (first + 1)
    weights = 1.0 / one.variance[begun : first + 1]
    mean = (weights * one.z[begun : first + 1]).sum(axis=0) / weights.sum(axis=0)
    assert alarm.change == pytest.approx(mean) and alarm.abrupt
    assert alarm.sd == pytest.approx(weights.sum(axis=0) ** -0.5)
    assert alarm.distance == pytest.approx(np.linalg.norm(mean * weights.sum(axis=0) ** 0.5))


@pytest.mark.parametrize(
    ("statistic", "change", "abrupt", "cause"),
    [
        (2, (-0.05, -0.02, -0.3), True, "wet or slippery road"),
        (2, (-0.2, -0.02, -0.3), True, "other tires"),
        (2, (-0.01, -0.01, 0.3), False, "wear, or a slow leak"),
        (0, (-0.1, -0.09, 0.0), True, "both axles alike: other tires, or another load"),
        (0, (-0.1, -0.09, 0.0), False, "both axles alike: wear, or tire pressure"),
        (0, (-0.1, -0.071, 0.0), False, "both axles alike: wear, or tire pressure"),
        (1, (-0.071, -0.1, 0.0), False, "both axles alike: wear, or tire pressure"),
        (1, (-0.1, -0.06, 0.0), True, "other tires or a loss of pressure"),
        (0, (-0.1, -0.02, 0.0), False, "wear, or a slow leak"),
        (0, (-0.02, -0.021, 0.0), True, "other tires or a loss of pressure"),
    ],
)
def test_an_alarm_names_what_is_likely_and_all_it_knows(statistic, change, abrupt, cause):
    alarm = Alarm(
        car="red", statistic=statistic, began="a", log="b", date="2026-01-02", after=1830.0,
        change=change, sd=(0.01, 0.01, 0.05), distance=7.0, abrupt=abrupt, ended="c",
    )  # fmt: skip
    percent = 100.0 * math.expm1(change[statistic])
    sd = 5 if statistic == 2 else 1
    assert alarm.cause == cause and f" {percent:+.0f} % (sd {sd} %) since a, " in alarm.line
    way = "in a step" if abrupt else "slowly"
    assert alarm.line.endswith(
        f"{way}, noticed at b after 30 min of learning: {cause}; over since c"
    )
    assert "over since" not in replace(alarm, ended="").line
    told = alarm.to_dict()
    assert told["change"] == pytest.approx(percent / 100.0) and told["likely"] == cause
    assert (told["changes_ln"], told["sd_ln"]) == (list(change), [0.01, 0.01, 0.05])
    assert (told["learning_s"], told["over_since"], told["abrupt"]) == (1830.0, "c", abrupt)
    assert (told["began"], told["noticed"], told["date"]) == ("a", "b", "2026-01-02")
    assert replace(alarm, ended="").to_dict()["over_since"] is None
