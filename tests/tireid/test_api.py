"""The one import: complete, lazy, typed, and the same numbers as the rooms behind it."""

import ast
import builtins
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest

import tireid as ti
from codegen import markup
from codegen.markup import AXLE_COLORS
from identifier.methods import make_method
from identifier.verdict import Objection
from models.recordings import RecordingError
from mpc.prediction import build_dynamics
from mpc.tires import prediction_tire
from tests.tireid.conftest import columns_of, json_of, learn_words, typed

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("codegen", "models", "identifier", "mpc", "tireid")
HEAVY = {"matplotlib", "control", "scipy", "casadi", "numpy"}
KINDS = ("axle", "integral", "linear", "lagged_ekf")
MARKUP = 20_000  # bytes that a notebook stores of a run, at most
STATES = ((0.0, 0.0, 0.02), (0.3, 0.4, 0.05), (-1.2, 0.2, -0.1))  # v_y, r, delta


@pytest.fixture(scope="module")
def car():
    return ti.sedan()


@pytest.fixture(scope="module")
def log(logs):
    return ti.read_recording(logs / "slalom.csv")


@pytest.fixture(scope="module")
def run(log, car):
    return ti.identify(log, car)


@pytest.fixture(scope="module")
def tires(log, car):
    """What every kind of method froze to, by its name."""
    return {name: ti.identify(log, car, make_method(name, car)).freeze() for name in KINDS}


def imported_by(code):
    """Packages that a fresh Python has imported after some code."""
    script = f"import sys\n{code}\nprint(*(m.split('.')[0] for m in sys.modules), file=sys.stderr)"
    command = [sys.executable, "-c", script]
    told = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(told.stderr.split())


def help_of(words):
    return (
        "from tireid.cli import main\n"
        f"try:\n    main({words})\nexcept SystemExit as stop:\n    assert not stop.code"
    )


@pytest.mark.parametrize("code", ["import tireid", help_of("[]"), help_of("['--help']")])
def test_the_door_opens_without_what_stands_behind_it(code):
    assert not imported_by(code) & HEAVY


def test_what_is_used_is_imported_and_drawing_still_is_not():
    packages = imported_by("import tireid as ti; ti.sedan(); ti.identify; ti.read_recording")
    assert "casadi" in packages and "matplotlib" not in packages


@pytest.mark.sweep("identify*")
@pytest.mark.parametrize(
    ("command", "unwanted"),
    [
        ("fleet", {"scipy", "matplotlib", "pyarrow"}),
        ("identify", {"scipy"}),
        ("predict", {"scipy"}),
    ],
)
def test_a_command_begins_without_what_only_some_of_its_options_need(command, unwanted):
    assert not imported_by(help_of(f"[{command!r}, '--help']")) & unwanted


def test_every_promised_name_is_there_and_an_unknown_one_is_refused():
    for name in ti.__all__:
        assert getattr(ti, name) is not None
    assert dir(ti) == sorted(ti.__all__)
    with pytest.raises(AttributeError, match="no attribute 'identifyy'"):
        ti.identifyy  # noqa: B018


def test_python_m_tireid_is_the_command_line():
    told = subprocess.run(
        [sys.executable, "-m", "tireid", "--version"], capture_output=True, text=True, check=True
    )
    assert told.stdout == f"tireid {ti.__version__}\n"


def test_the_command_and_the_function_write_the_same_model(logs, run, out, undrawn):
    words = learn_words(logs)
    assert typed(*words, "--out", out) == 0
    told = {"valid": run.verdict.valid}
    model = run.tire
    assert json_of(out / "weights.json") == model.to_dict() | told
    assert ti.TireModel.load(out / "weights.json").to_dict() == model.to_dict()
    assert model.to_dict() == run.freeze().to_dict() | {"force_missed": [*model.model_error]}


def test_the_tire_of_a_run_is_what_it_freezes_to_with_a_calibrated_band(log, car):
    run = ti.identify(log, car, "axle")
    tire, frozen = run.tire, run.freeze()
    assert tire.band.calibrated and "calibrated on the drive" in tire.summary()
    assert not frozen.band.calibrated and "run.tire calibrates it" in frozen.summary()


def test_a_run_names_its_parts(log, car, tmp_path):
    run = ti.identify(log, car, "integral")
    assert run.recording is run.history.recording and run.force is run.history.axle_force
    assert run.method.law == "integral" and run.vehicle is car
    assert run.certificate.to_dict() == ti.certify("integral", car).to_dict()
    run.save(tmp_path / "run")
    again = ti.TireModel.load(tmp_path / "run" / "weights.json")
    assert again.to_dict() == run.tire.to_dict()
    told = json_of(tmp_path / "run" / "verdict.json")
    assert told["valid"] == run.verdict.valid
    with pytest.raises(FileExistsError, match="overwrite=True replaces it"):
        run.save(tmp_path / "run")
    run.save(str(tmp_path / "run"), overwrite=True)


def test_all_errors_have_one_base_and_the_builtin_of_their_meaning():
    for path in (path for name in PACKAGES for path in (ROOT / name).rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            bases = [one.id for one in getattr(node, "bases", []) if isinstance(one, ast.Name)]
            errors = [issubclass(getattr(builtins, one, object), BaseException) for one in bases]
            if any(errors) and node.name != "TireidError":
                assert not errors[0], f"{path}: {node.name}"
    for error in [one for one in vars(ti.errors).values() if isinstance(one, type)]:
        assert issubclass(error, ti.TireidError)
        meanings = ValueError | ArithmeticError | RuntimeError
        assert error is ti.TireidError or issubclass(error, meanings)


def test_a_recording_is_sliced_by_time_and_made_a_frame(log):
    part = log[2.0:4.0]
    assert part.t[0] == 2.0 and part.t[-1] == 4.0
    assert np.array_equal(log[:4.0].r, log.between(log.t[0], 4.0).r)
    assert len(log[:]) == len(log)
    for wrong in (3, slice(0.0, 4.0, 2.0)):
        with pytest.raises(TypeError, match=r"sliced by time in s, as log\[5.0:20.0\]"):
            log[wrong]
    with pytest.raises(RecordingError, match="between 90 and 95 s there are 0"):
        log[90.0:95.0]
    pytest.importorskip("pandas", reason="needs pandas, which is no dependency")
    again = ti.read_recording(log.to_dataframe(), name=log.name)
    assert again.name == log.name and np.array_equal(again.axle_force, log.axle_force)
    assert all(np.array_equal(getattr(again, one), getattr(log, one)) for one in ("t", "x", "u"))


def test_a_recording_of_another_car_is_refused(log, car):
    swapped = replace(car, l_f=4.0 * car.l_f, l_r=4.0 * car.l_r, yaw_inertia=16 * car.yaw_inertia)
    with pytest.raises(RecordingError):
        ti.identify(log, swapped)
    ti.identify(log, swapped, check=False)


class Frame:
    """As much of a data frame as pandas and polars share."""

    def __init__(self, columns):
        self._columns, self.columns = columns, list(columns)

    def __getitem__(self, name):
        return self._columns[name]


@pytest.mark.parametrize("kind", [dict, Frame])
def test_arrays_are_read_as_a_file_is(kind, log):
    same = ti.read_recording(kind(columns_of(log)), name="mine")
    assert same.name == "mine"
    assert np.allclose(same.x, log.x, atol=1e-12) and not same.delta_r.any()
    assert same.a_y is None and same.axle_force is None


def test_a_pandas_frame_is_read(log):
    pandas = pytest.importorskip("pandas", reason="needs pandas, which is no dependency")
    frame = pandas.DataFrame({**columns_of(log), "run": "lap 2", "comment": "x"})
    assert ti.read_recording(frame).name == "recording:lap 2"


def test_an_index_that_rises_is_the_time_of_a_frame_without_one(log):
    pandas = pytest.importorskip("pandas", reason="needs pandas, which is no dependency")
    frame = pandas.DataFrame(columns_of(log)).set_index("t")
    seconds = pandas.to_timedelta(frame.index, unit="s")
    for index in (frame.index, seconds, pandas.Timestamp("2026-11-29", tz="UTC") + seconds):
        read = ti.read_recording(frame.set_index(index.rename("stamp")))
        np.testing.assert_allclose(read.t - read.t[0], log.t - log.t[0], atol=1e-9)
        np.testing.assert_allclose(read.r, log.r, atol=1e-9)
        assert "time is the index of the data frame, 'stamp'" in read.notes
    with pytest.raises(RecordingError, match=r'the time \[s\]; columns=\{"t": "when"\}\?'):
        ti.read_recording(frame.reset_index(names="when"))
    with pytest.raises(RecordingError, match="column t is missing"):  # it counts rows
        ti.read_recording(frame.reset_index(drop=True))


def test_an_estimated_v_y_is_displayed_and_never_read_as_measured(log, car):
    pytest.importorskip("pandas", reason="needs pandas, which is no dependency")
    found = ti.identify(replace(log, v_y=None), car).recording
    frame = found.to_dataframe()
    np.testing.assert_array_equal(frame.vy_estimated, found.v_y)
    assert "v_y (estimated)" in found._repr_html_() and "vy" not in frame
    assert ti.read_recording(frame).v_y is None
    assert "vy" in log.to_dataframe()


def test_headers_of_two_levels_and_names_without_a_letter_are_no_crash(log):
    pandas = pytest.importorskip("pandas", reason="needs pandas, which is no dependency")
    frame = pandas.DataFrame(columns_of(log))
    levels = frame.set_axis(pandas.MultiIndex.from_product([frame.columns, ["SI"]]), axis=1)
    with pytest.raises(RecordingError, match=r"2 levels.*df.columns.droplevel\(1\)"):
        ti.read_recording(levels)
    with pytest.raises(RecordingError, match="several columns are called vy: rename them"):
        ti.read_recording(pandas.concat([frame, frame[["vy"]]], axis=1))
    strange = frame.rename(columns={"r": "YawRate [rad/s]"}).assign(**{"%": 1.0, "[m/s]": 2.0})
    np.testing.assert_allclose(ti.read_recording(strange).r, log.r, atol=1e-9)


def test_errors_of_arrays_name_arguments_and_no_options(log):
    columns = columns_of(log)
    steering = 14.6 * np.degrees(columns.pop("delta_f"))
    with pytest.raises(RecordingError) as caught:
        ti.read_recording(columns | {"SteeringWheel [deg]": steering, "v": columns.pop("vx")})
    words = 'columns={"vx": "v [UNIT]", "delta_f": "SteeringWheel [deg] /RATIO"}'
    assert words in str(caught.value)
    assert not re.search("--|tireid channels", str(caught.value))


def test_columns_of_another_name_and_runs_are_chosen(log):
    columns = columns_of(log)
    columns["yaw_rate"] = columns.pop("r")
    twice = {name: np.concatenate([value, value]) for name, value in columns.items()}
    twice["run"] = np.repeat(["a", "b"], log.t.size)
    read = ti.read_recording(twice, run="b", columns={"r": "yaw_rate"})
    assert read.name == "recording:b" and np.allclose(read.r, log.r)
    with pytest.raises(RecordingError, match="name one of its runs: a, b"):
        ti.read_recording(twice, columns={"r": "yaw_rate"})
    with pytest.raises(RecordingError, match="did you mean 'yaw_rate' for r"):
        ti.read_recording(twice, run="b")


@pytest.mark.parametrize("kind", ["datetime64[ns]", "datetime64[us]", "timedelta64[ms]"])
def test_times_of_the_calendar_and_durations_count_from_the_first(log, kind):
    milliseconds = np.round(1e3 * (log.t - log.t[0])).astype("timedelta64[ms]")
    start = np.datetime64("2026-03-29T00:59:55") if kind.startswith("d") else 0
    stamped = columns_of(log) | {"t": (start + milliseconds).astype(kind)}
    told = ti.read_recording(stamped)
    plain = ti.read_recording(columns_of(log) | {"t": log.t - log.t[0]})
    np.testing.assert_allclose(told.t, plain.t, atol=1e-9)
    np.testing.assert_allclose(told.r, plain.r, atol=1e-9)
    stamped["t"][7] = "NaT"
    with pytest.raises(RecordingError, match="t must be a time in every row, position 7 has none"):
        ti.read_recording(stamped)


def test_an_hour_that_is_there_twice_in_summer_time_is_no_jump(log):
    pandas = pytest.importorskip("pandas", reason="needs pandas, which is no dependency")
    t = pandas.to_datetime("2026-10-25 00:59:55", utc=True) + pandas.to_timedelta(log.t, unit="s")
    data = pandas.DataFrame(columns_of(log) | {"t": t.tz_convert("Europe/Berlin")})
    np.testing.assert_allclose(ti.read_recording(data).t, log.t - log.t[0], atol=1e-6)


@pytest.mark.parametrize("name", KINDS)
def test_force_takes_numbers_and_arrays_of_any_shape(tires, name):
    tire = tires[name]
    grid = np.array([[-0.05, 0.01, 0.0], [0.02, 0.1, 0.2]])
    both = tire.force(grid)
    assert both.shape == (2, 3, 2)
    np.testing.assert_allclose(tire.force(grid, "rear"), both[..., 1], rtol=1e-12)
    assert tire.force([], "front").shape == (0,)
    one = tire.force(0.1, axle="front")
    assert isinstance(one, float) and one == pytest.approx(both[1, 1, 0], rel=1e-12)
    with pytest.raises(ValueError, match="front or rear, it is 'middle'"):
        tire.force(0.1, "middle")


@pytest.mark.parametrize("name", KINDS)
def test_force_is_what_a_straight_drifting_car_would_be_told(tires, name):
    """δ = 0, r = 0 and v_y = -v_x tan α: both axles slip by α, and the lag has settled."""
    tire, n, alpha, v_x = tires[name], 400, 0.03, 15.0
    small = name in ("integral", "linear")  # their slip angle is that of (3)
    v_y = -v_x * (alpha if small else np.tan(alpha))
    steering, bias = 0.0, 0.0  # of the sensors, where a model takes them off
    if name in ("axle", "lagged_ekf"):
        steering, bias = tire.offset
    v_y += bias
    drifting = ti.Recording(
        name="drift",
        t=0.01 * np.arange(n),
        v_x=np.full(n, v_x),
        v_y=np.full(n, v_y),
        **{signal: np.zeros(n) for signal in ("r", "delta_f", "delta_r")},
    )
    told = tire.predict(drifting)[-1]
    expected = tire.force(alpha, v_x=v_x)
    if steering:
        expected = np.array([tire.force(alpha + steering, "front"), expected[1]])
    assert np.allclose(told, expected, rtol=1e-3)


@pytest.mark.parametrize("name", KINDS)
def test_stiffness_is_the_slope_at_zero(tires, name):
    tire, small = tires[name], 1e-5
    slope = (tire.force(small) - tire.force(-small)) / (2.0 * small)
    assert np.allclose(tire.stiffness, slope, rtol=1e-3)
    if name == "linear":
        assert np.array_equal(tire.stiffness, tire.vehicle.bicycle[4:])


@pytest.mark.parametrize("name", KINDS[:-1])
def test_the_equations_of_motion_are_those_of_the_tracker(tires, name):
    """In the frame of a straight path at heading 0 the tracker's v̇_y, ṙ are the car's."""
    tire = tires[name]
    theirs = prediction_tire(tire)
    tracker, dynamics = build_dynamics(theirs.structure), tire.casadi_function().dynamics
    for v_y, r, delta in STATES:
        slips = [0.03, -0.02] if tire.lagged else []
        x = np.array([0.0, 0.0, v_y, r, delta, *slips])
        told = tracker(
            *(x, 0.0, 0.0, 18.0, 1e-9, theirs.car, theirs.weights),
            *([np.inf, np.inf], [0.0, 0.0], 1.0),
        )
        ours = dynamics([v_y, r, *slips], delta, 18.0)[0]
        rows = [2, 3, *([5, 6] if tire.lagged else [])]
        assert np.allclose(np.array(ours).ravel(), np.array(told).ravel()[rows], rtol=1e-9)


@pytest.mark.sweep("axle", "linear")
@pytest.mark.parametrize("name", KINDS)
def test_the_step_integrates_the_equations_of_motion(tires, name):
    tire = tires[name]
    functions = tire.casadi_function()
    assert [f.name() for f in functions] == ["tire_force_curve", "car_dynamics", "car_step"]
    assert functions.step.name_in() == ["x", "delta", "v_x", "dt"]
    x = x0 = np.array([0.2, 0.1, *([0.02, 0.01] if tire.lagged else [])])
    dt, parts = 0.005, 4000
    for _ in range(parts):  # Euler, in steps that are small enough
        x = x + dt / parts * np.array(functions.dynamics(x, 0.04, 20.0)[0]).ravel()
    once = np.array(functions.step(x0, 0.04, 20.0, dt)).ravel()
    assert np.allclose(once, x, atol=1e-3 * np.abs(x - x0).max())


def test_the_lag_of_a_step_is_bounded_so_that_it_stays_stable(tires):
    step = tires["axle"].casadi_function().step
    x = np.array([0.0, 0.0, 0.1, -0.1])
    for _ in range(50):
        x = np.array(step(x, 0.0, 40.0, 0.2)).ravel()
    assert np.abs(x).max() < 1.0


def test_the_functions_have_derivatives(tires):
    for tire in tires.values():
        dynamics = tire.casadi_function().dynamics
        x = ca.MX.sym("x", dynamics.size1_in("x"))
        J = ca.Function("J", [x], [ca.jacobian(dynamics(x, 0.05, 20.0)[0], x)])
        at = np.full(x.numel(), 0.01)
        assert np.isfinite(np.array(J(at))).all()


@pytest.mark.parametrize("name", KINDS)
def test_a_saved_model_comes_back(tires, log, tmp_path, name):
    path = str(tmp_path / "tire.json")
    tires[name].save(path)
    again = ti.TireModel.load(path)
    assert type(again) is type(tires[name])
    assert np.array_equal(again.predict(log), tires[name].predict(log))


def test_no_method_goes_on_from_a_curve(tires, out):
    with pytest.raises(ValueError, match="no method can continue a LinearModel"):
        ti.export(tires["linear"], out)
    assert not out.exists()


def test_logs_runs_and_tires_are_equal_to_themselves_alone(log, run, tires):
    """Arrays in a record would make == of two an error, and none of them a key."""
    for one in (log, run, ti.replay(log, tires["axle"]), *tires.values()):
        assert one == one and len({one, one}) == 1
    assert log != replace(log) and tires["axle"] != run.freeze()


def test_a_notebook_displays_the_answers_of_a_run(log, car, tires):
    hostile = replace(log, name="<script>a</script> & b", notes=("<i>read</i>",))
    run = ti.identify(hostile, car)
    page = run._repr_html_()
    assert len(page) < MARKUP and run.verdict.word in page
    for part in (run.recording, run.tire, run.verdict):
        assert part._repr_html_() in page
    words = " ".join(" ".join(ElementTree.fromstring(page).itertext()).split())  # well-formed
    for text in (hostile.name, "<i>read</i>", "yaw rate rad/s", *run.verdict.lines[1:2]):
        assert text in words
    for color in AXLE_COLORS:
        assert page.count(color) == 4  # name, band, curve as far as it is known and beyond
    assert all("<polyline" in tire._repr_html_() for tire in tires.values())
    assert "line-through" not in page
    run.__dict__["verdict"] = replace(
        run.verdict,
        findings=(Objection("force_missed", "front", "it misses", True),),
        numbers=tuple(one._replace(valid=one.axle == "rear") for one in run.verdict.numbers),
    )
    page = run._repr_html_()
    assert page.count(markup.STRUCK) == page.count(f'{markup.REFUSED}">') > 3  # front, rear
    filtered = ti.identify(log, car, make_method("linear_kf", car))._repr_html_()
    assert "No tires:" in filtered and "<svg" not in filtered


def test_plot_draws_tires_with_their_band_and_a_run_with_its_samples(run):
    for what, label in ((run.tire, "identified curve"), (run, "curve, steady")):
        labels = {text.get_text() for one in ti.plot(what).legends for text in one.get_texts()}
        assert labels >= {label, "band of 90 %"}
