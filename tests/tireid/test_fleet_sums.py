"""A fleet's arithmetic by another road: rows that are made, sums and tests written out again."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from identifier.estimate.chosen import CHOSEN as ESTIMATE_CHOSEN
from identifier.estimate.information import SIZE, Information, coordinates
from identifier.estimate.priors import Priors
from identifier.estimate.solve import settled
from identifier.frozen import vehicle_numbers
from identifier.motion.parameters import INDEX
from models.vehicle import sedan
from tireid.fleet.chosen import CHOSEN as FLEET_CHOSEN
from tireid.fleet.merge import (
    _CHANGES,
    _TIRES,
    MergeError,
    _key_of,
    errors_of,
    fleet_prior,
    merge,
    sizes,
    usable,
)
from tireid.fleet.store import _OBSERVABLE, LogRow, Store, information_columns
from tireid.fleet.watch import Alarm, Watching, _change_from, watch

pyarrow = pytest.importorskip("pyarrow", reason="needs pyarrow and fsspec")
pytest.importorskip("fsspec", reason="needs pyarrow and fsspec")
parquet = pytest.importorskip("pyarrow.parquet")

CAR = replace(sedan(), chassis=None)
Q = len(_OBSERVABLE)
SCALES = np.append(np.full(20, 0.05), np.full(Q - 20, 0.02))  # of u that a residual of 1 is worth


def told_of(p, rng, *, seconds=60.0, noise=0.0):
    """Information of random residuals, linear in u, of parameters (p,)."""
    u, _ = coordinates(p)
    J = rng.normal(size=(200, Q)) / SCALES / 4.0
    y = J @ u[_OBSERVABLE] + noise * rng.normal(size=200)
    matrix, vector = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
    matrix[np.ix_(_OBSERVABLE, _OBSERVABLE)] = 0.5 * (J.T @ J + (J.T @ J).T)
    vector[_OBSERVABLE] = J.T @ y
    return Information(matrix=matrix, vector=vector, seconds=seconds)


def tires(front=1.0, rear=1.0, friction=1.0, car=CAR):
    """Parameters of tires stiffer than those of the prior, or on another road."""
    p = Priors.of(car).mean.copy()
    p[INDEX["ln_stiffness_f"]] += np.log(front)
    p[INDEX["ln_stiffness_r"]] += np.log(rear)
    for axle in "fr":
        p[INDEX[f"ln_grip_{axle}"]] += np.log(friction)
    return p


def merged(rows, by):
    return merge(lambda: iter(rows), by)


def row_of(k, parts, *, car=CAR, **more):
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
        part_begin=[60.0 * i for i in range(len(parts))],
        **information_columns(parts),
    )
    return replace(row, **more)


def test_what_parts_tell_comes_back_from_a_store(tmp_path):
    rng = np.random.default_rng(1)
    parts = [told_of(tires(), rng, seconds=s) for s in (60.0, 31.0)]
    store = Store(str(tmp_path / "store"))
    store.keep([row_of(0, parts)])
    store.settle()
    (row,) = store.rows()
    assert row == replace(row_of(0, parts), findings=[]) and len(row.matrix) == 2 * Q * (Q + 1) // 2
    path = tmp_path / "store" / "logs" / row.bucket
    table = parquet.read_table(path)
    for name in ("tires", "findings"):  # as another program may leave them
        empty = pyarrow.nulls(1, table.schema.field(name).type)
        table = table.set_column(table.column_names.index(name), name, empty)
    parquet.write_table(table, path)
    assert store.rows() == [replace(row, tires="", findings=())]
    for one, back in zip(parts, row.parts, strict=True):
        for name in ("matrix", "vector"):
            assert (getattr(back, name) == getattr(one, name)).all()
        assert back.seconds == one.seconds


def test_logs_are_spread_over_sixteen_files_and_the_runs_of_one_lie_together():
    rows = [row_of(k, []) for k in range(200)]
    assert len({row.bucket for row in rows}) == 16
    for row in rows[:9]:
        others = [replace(row, **more) for more in ({"run": "2"}, {"setting": "x"}, {"log": "y"})]
        assert {one.bucket for one in others} == {row.bucket}
    assert len({replace(row, content="").bucket for row in rows}) == 16


def test_a_merged_model_is_the_optimum_of_prior_and_logs():
    rng = np.random.default_rng(3)
    parts = [told_of(tires(1.1, 0.9), rng, noise=1.0) for _ in range(6)]
    rows = [row_of(k, parts[2 * k : 2 * k + 2]) for k in range(3)]
    (one,) = merged(rows, ["vehicle", "month", "driver"])
    assert one.key == (("vehicle", CAR.name), ("month", "2026-01"), ("driver", "ann"))
    assert (one.name, one.logs, one.elsewhere) == (f"{CAR.name} 2026-01 ann", 3, 0)
    assert merged(rows, [])[0].name == "all"
    beliefs, model = Priors.of(CAR), one.model
    sd = FLEET_CHOSEN.apart * beliefs.sd[[INDEX[name] for name in _CHANGES]]

    def cost(p):
        """Over each log's own errors of sensors, the least."""
        u, _ = coordinates(p)
        total = 0.5 * (p - beliefs.mean) @ beliefs.information @ (p - beliefs.mean)
        for part in parts:
            along, _ = errors_of(beliefs)
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
    assert model.covariance[k, k] > sd[_CHANGES.index("v_y_bias")] ** 2  # of the next log
    assert model.driven.tolist() == [0.02, 0.1] and model.speeds.tolist() == [8.0, 20.0]
    assert model.a_x.tolist() == [-1.0, 0.2] and one.information.seconds == 360.0


def test_a_log_of_a_wet_road_does_not_lower_the_grip_of_the_others():
    rng = np.random.default_rng(7)
    dry = [row_of(k, [told_of(tires(), rng, noise=1.0)]) for k in range(4)]
    wet = row_of(4, [told_of(tires(friction=0.5), rng, noise=1.0)])
    (alone,), (both,) = merged(dry, []), merged([*dry, wet], [])
    assert (alone.elsewhere, both.elsewhere, both.logs) == (0, 1, 5)
    far = ESTIMATE_CHOSEN.grid.index(0.19)
    alone, both = (coordinates(one.model.p)[0][far] for one in (alone, both))
    assert both == pytest.approx(alone, rel=0.03)
    told = sum((row.parts[0] for row in [*dry, wet]), Information.nothing())
    together = coordinates(settled(Priors.of(CAR).after(told), tires())[0])[0][far]
    assert together < 0.95 * alone


def test_rows_are_grouped_by_what_they_say_and_a_log_counts_once():
    rng = np.random.default_rng(4)
    rows = [row_of(k, [told_of(tires(), rng)]) for k in range(40)]
    assert [len(merged(rows, [name])) for name in ("log", "week", "month", "tires", "setting")] == [
        40, 7, 2, 1, 1,
    ]  # fmt: skip
    assert _key_of(rows[4], ["week", "date"]) == (("week", "2026-W02"), ("date", "2026-01-05"))
    assert _key_of(row_of(0, [], date="2024-12-30T10:00"), ["week"]) == (("week", "2025-W01"),)
    again = replace(rows[3], setting="otherwise")
    with pytest.raises(MergeError, match=r"^003 has rows of two settings, told and otherwise"):
        merged([*rows, again], [])
    assert len(merged([*rows, again], ["setting"])) == 2
    assert merged([*rows, replace(rows[3], run="2")], [])[0].logs == 41
    other = row_of(50, [told_of(tires(), rng)], car=replace(CAR, mass=1600.0))
    for ask in (lambda: merged([*rows, other], []), lambda: watch([*rows, other], [], Watching())):
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
        p = tires(*np.exp(0.1 * rng.normal(size=3)), car=car)
        rows.append(row_of(k, [told_of(p, rng, noise=1.0)], car=car))
    groups = merged(rows, ["vehicle"])
    prior = fleet_prior(groups)
    size = sizes(cars[0])
    lengths = [INDEX["compliance_f"], INDEX["compliance_r"]]
    wheelbase = cars[0].wheelbase
    assert size.tolist() == [wheelbase if k in lengths else 1.0 for k in _TIRES]
    stiff = _TIRES.index(INDEX["ln_stiffness_f"])
    told = [one.model["ln_stiffness_f"] for one in groups]
    assert prior.mean[stiff] == pytest.approx(np.mean(told), abs=0.1)
    m0 = np.mean([Priors.of(car).mean[_TIRES] / sizes(car) for car in cars], axis=0)
    S0 = np.mean(
        [
            Priors.of(car).covariance[np.ix_(_TIRES, _TIRES)] / np.outer(sizes(car), sizes(car))
            for car in cars
        ],
        axis=0,
    )
    known = []
    for one, car in zip(groups, cars, strict=True):  # what is marginal, by the inverse of a whole
        usual, moves = Priors.of(car), np.flatnonzero(Priors.of(car).moves)
        _, slope, H = one.information.around(one.model.p)
        sensors = [k for k in moves if k not in _TIRES]
        H[np.ix_(sensors, sensors)] += usual.information[np.ix_(sensors, sensors)]
        covariance = np.linalg.inv(H[np.ix_(moves, moves)])
        some = [list(moves).index(k) for k in _TIRES]
        matrix = np.linalg.inv(covariance[np.ix_(some, some)])
        vector = matrix @ one.model.p[_TIRES] - slope[_TIRES]
        known.append((matrix * np.outer(sizes(car), sizes(car)), vector * sizes(car)))
    m, T = m0, S0
    for _ in range(FLEET_CHOSEN.passes):
        P = [np.linalg.inv(np.linalg.inv(T) + matrix) for matrix, _ in known]
        means = [one @ (np.linalg.solve(T, m) + v) for one, (_, v) in zip(P, known, strict=True)]
        M = np.linalg.inv(5.0 * np.linalg.inv(T) + np.linalg.inv(S0))
        m = M @ (np.linalg.solve(T, np.sum(means, axis=0)) + np.linalg.solve(S0, m0))
        away = np.array(means) - m
        T = (2.0 * S0 + away.T @ away + np.sum(P, axis=0)) / 7.0
    sd = np.sqrt(np.diag(T))
    assert np.abs((prior.mean - m) / sd).max() < 1e-3
    assert np.abs((prior.spread - T - M) / np.outer(sd, sd)).max() < 1e-3
    model = prior.model(cars[0])
    assert model.p[_TIRES] == pytest.approx(m * size, abs=1e-3)
    both = np.ix_(_TIRES, _TIRES)
    assert model.covariance[both] == pytest.approx(prior.spread * np.outer(size, size))
    off = INDEX["v_y_bias"]
    assert model.covariance[off, off] == Priors.of(cars[0]).covariance[off, off]
    assert (prior.cars, model.vehicle) == (5, cars[0])


# Watching: Page's sums written out, part by part.


@pytest.fixture(scope="module")
def driven():
    """Two cars, one of which loses a fifth at the front; a third that has hardly begun."""
    rng = np.random.default_rng(6)
    rows = []
    for name, change in (("a", 0.8), ("b", 1.0)):
        for k in range(60):
            p = tires(np.exp(0.02 * rng.normal()) * (change if k >= 35 else 1.0))
            parts = [told_of(p, rng, noise=1.0), told_of(p, rng, seconds=4.0)]
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
        beliefs, base = Priors.of(CAR), Information.nothing()
        for one in told[:20]:
            base += one.loosened(*errors_of(beliefs))
        p, _ = settled(beliefs.after(base), beliefs.mean)
        changes = [_change_from(one, p, beliefs) for one in told]
        z, S = (np.array(each) for each in zip(*changes, strict=True))
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
