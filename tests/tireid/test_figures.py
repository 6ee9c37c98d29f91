"""Figures: units on every axis, legends beside the data, nothing clipped, truth or no truth."""

import re
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.ticker import FixedLocator

from identifier.axle import AxleIdentifier
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import Gains, diagonal
from identifier.paper.network import Network
from identifier.reproducibility import AxleRmse, Replay, Reproduction
from identifier.run import History
from identifier.verdict import WindowForces
from models.recordings import Recording
from models.vehicle import Vehicle
from tests.tireid.test_drive_figures import FIGURES as DRIVEN
from tests.tireid.test_drive_figures import curves, ends_of
from tireid.figures import style
from tireid.figures.forces import (
    force_figure,
    inputs_figure,
    prediction_figure,
)
from tireid.figures.paper import comparison_figure, error_figure, weights_figure
from tireid.figures.style import (
    figure_png,
    force_unit_of,
    save_figures,
)
from tireid.figures.tires import learnt_axles_figure, slip_figure

N = 300
CAR = Vehicle(
    mass=1500.0,
    yaw_inertia=2500.0,
    l_f=1.2,
    l_r=1.5,
    cornering_stiffness_front=1e5,
    cornering_stiffness_rear=1.2e5,
)
GAINS = Gains(A_d=diagonal(10.0), forgetting=10.0, eta_W=1.0, eta_V=1.0, rho_W=0.1, rho_V=0.1)


def made_up(scale=5000.0, *, truth=True, rear=0.0):
    """A history with invented signals: figures do not ask where numbers come from."""
    rng = np.random.default_rng(1)
    t = np.linspace(20.0, 20.0 + 0.01 * (N - 1), N)
    wave = np.sin(3.0 * t)
    force = scale * np.column_stack([wave, 0.7 * wave])
    recording = Recording(
        name="log:run",
        t=t,
        v_x=np.full(N, 15.0),
        v_y=0.1 * wave,
        r=0.2 * wave,
        delta_f=0.05 * wave,
        delta_r=rear * wave,
        a_y=4.0 * wave,
        axle_force=force if truth else None,
    )
    unit = 1000.0 if scale > 100.0 else 1.0
    return History(
        vehicle=CAR,
        method=PaperIdentifier(gains=GAINS, network=Network(hidden=3), force_unit=unit),
        recording=recording,
        axle_force=1.1 * force,
        outputs={"f_hat": 0.1 * force / unit, "xi_tilde": 0.01 * rng.standard_normal((N, 2))},
        state={
            "z": np.zeros((N + 1, 2)),
            "W": np.cumsum(rng.standard_normal((N + 1, 2, 3)), axis=0),
            "V": np.cumsum(rng.standard_normal((N + 1, 3, 4)), axis=0),
        },
    )


def replayed(history):
    error = AxleRmse(front=430.0, rear=210.0)
    return Replay(
        recording=history.recording,
        axle_force=0.9 * history.axle_force,
        against_truth=error if history.recording.axle_force is not None else None,
        against_online=AxleRmse(front=120.0, rear=110.0),
    )


def frozen_replays(history):
    return {22.0: replayed(history), 21.0: replayed(history)}


MADE, BLIND = made_up(), made_up(truth=False)
_RISING = np.linspace(-0.05, 0.05, 20)[:, None] * [1.0, 0.6]
WINDOWS = WindowForces(np.linspace(20.2, 22.8, 20), 8e4 * _RISING, 9e4 * _RISING, _RISING)
RESULTS = {
    "instantaneous": {"online": (0.3, 0.2, 0.4), "32": (1.1, 0.9, 1.4)},
    "integral": {"online": (0.3, 0.2, 0.4), "32": (0.4, 0.3, 0.5)},
    "instantaneous_scaled": {"online": (0.3, 0.2, 0.4), "32": (0.4, 0.3, 0.5)},
}
PAPER = {"integral": {"online": 0.3386, "32": 0.4247}}

FIGURES = {
    "forces": lambda: force_figure(MADE, frozen_replays(MADE)),
    "forces without truth": lambda: force_figure(BLIND, frozen_replays(BLIND)),
    "forces of a model car": lambda: force_figure(made_up(5.0), window=(20.5, 21.5)),
    "slip": lambda: slip_figure(MADE.freeze(22.0), MADE.recording),
    "slip without truth": lambda: slip_figure(BLIND.freeze(22.0), BLIND.recording, WINDOWS),
    "error": lambda: error_figure(MADE, freeze_times=[21.0]),
    "error under bounds": lambda: error_figure(MADE, {"X": 3.0, "trivial": 0.5}, [21.0]),
    "weights": lambda: weights_figure(MADE, [21.0, 22.0]),
    "inputs": lambda: inputs_figure(made_up(rear=0.01).recording),
    "comparison": lambda: comparison_figure(RESULTS, PAPER),
    "prediction": lambda: prediction_figure(replayed(MADE)),
    "prediction without truth": lambda: prediction_figure(replayed(BLIND), WINDOWS),
    "prediction alone": lambda: prediction_figure(replayed(BLIND)),
}
EVERY = FIGURES | DRIVEN
every_figure = pytest.mark.parametrize("draw", EVERY.values(), ids=EVERY.keys())


def clipped(figure):
    """Whether anything of a drawn figure lies outside of it."""
    figure.canvas.draw()
    drawn = figure.get_tightbbox()
    width, height = figure.get_size_inches()
    slack = 0.005  # inch
    return bool(
        drawn.x0 < -slack or drawn.y0 < -slack or drawn.x1 > width + slack
        or drawn.y1 > height + slack
    )  # fmt: skip


def legend_boxes(figure):
    legends = [axes.get_legend() for axes in figure.axes]
    found = [*figure.legends, *(legend for legend in legends if legend is not None)]
    return [legend.get_window_extent() for legend in found]


@every_figure
def test_outer_axes_have_labels_with_units(draw):
    for axes in draw().axes:
        place = axes.get_subplotspec()
        if place.is_first_col():
            assert re.search(r"\[.+\]$", axes.get_ylabel()), axes
        named = isinstance(axes.xaxis.get_major_locator(), FixedLocator)
        if place.is_last_row() and not named:
            assert re.search(r"\[.+\]$", axes.get_xlabel()), axes


@pytest.mark.sweep("slip", "weights", "comparison", "tires")
@every_figure
def test_nothing_is_clipped_and_no_legend_covers_data(draw):
    figure = draw()
    assert not clipped(figure)
    boxes = legend_boxes(figure)
    assert boxes
    for box in boxes:
        for axes in figure.axes:
            assert not box.overlaps(axes.get_window_extent())


def test_no_label_lies_on_the_numbers_of_its_axis():
    figure, panels = style.axle_panels([2.0, 1.0], sharex="col")
    for axes in panels.ravel():
        axes.plot([0.0, 1.0], [-0.0275, 0.0275])
        axes.set_ylabel("residual [kN]")
    figure.canvas.draw()
    for axes in panels[:, 0]:
        label = axes.yaxis.label.get_window_extent()
        numbers = [one.get_window_extent() for one in axes.get_yticklabels()]
        assert not any(label.overlaps(box) for box in numbers)


def test_same_data_give_the_same_bytes_and_leave_matplotlib_alone(tmp_path):
    before = dict(matplotlib.rcParams)
    first, second = figure_png(FIGURES["error"]()), figure_png(FIGURES["error"]())
    assert first == second
    save_figures(tmp_path, {"error": FIGURES["error"]()})
    assert (tmp_path / "error.png").read_bytes() == first
    assert dict(matplotlib.rcParams) == before


def test_the_paper_s_measure_stands_below_the_error_to_the_truth():
    past = AxleRmse(front=260.0, rear=140.0)
    sides = Reproduction(
        past_against_online=past, past_against_truth=None, after_against_truth=None
    )
    result = replace(replayed(MADE), reproduction=sides)
    figure = force_figure(MADE, {22.0: result})
    assert figure.axes[2].get_title("right") == "RMSE 0.43 kN\npast to online 0.26 kN"
    assert figure.axes[3].get_title("right") == "RMSE 0.21 kN\npast to online 0.14 kN"
    assert not clipped(figure)


def test_forces_of_a_model_car_are_in_newtons():
    assert FIGURES["forces of a model car"]().axes[0].get_ylabel() == "lateral force [N]"
    assert force_unit_of(np.array([np.nan, -2000.0])).name == "kN"


def unlike_axles():
    """A ladder whose axles differ in stiffness, grip and in how far they are known."""
    design = AxleIdentifier.for_vehicle(CAR)
    new = design.frozen(CAR, design.setup(CAR).carry)
    return replace(
        new,
        W=np.array([0.2, 0.3, 0.2, 0.1]) * np.array([[1.0], [0.4]]),
        covariance=1e-4 * new.prior_covariance,  # sure of everything that was seen
        excitation=np.array([[0.02], [0.01]]) * np.eye(1, new.excitation.shape[1]),
    )


def test_every_axle_has_its_own_curves_in_the_slip_figure():
    model, recording = unlike_axles(), MADE.recording
    figure = slip_figure(model, recording)
    loads = 1500.0 * 9.81 / 2.7 * np.array([1.5, 1.2])
    alpha, frozen = model.lagged_slip(recording), model.predict(recording)
    for axle, axes in enumerate(figure.axes[:2]):
        drawn = {label: line.T * [[np.radians(1.0)], [1e3]] for label, line in curves(axes).items()}
        slip, force = drawn["curve, steady"]
        units = np.tanh(slip[:, None] / np.array(model.ladder))
        np.testing.assert_allclose(force, loads[axle] * units @ model.W[axle], rtol=1e-6, atol=1e-6)
        for label, expected in (("truth", recording.axle_force), ("model", frozen)):
            slip, force = drawn[label]
            np.testing.assert_allclose(slip, alpha[:, axle], atol=1e-9)
            np.testing.assert_allclose(force, expected[:, axle], rtol=1e-9, atol=1e-6)
        linear = next(line for line in axes.lines if "linear" in line.get_label())
        stiffness = np.ptp(linear.get_ydata()) / np.ptp(linear.get_xdata())
        assert stiffness * 1e3 == pytest.approx((1e5, 1.2e5)[axle] * np.radians(1.0))
        edges = sorted(min(abs(x0), abs(x1)) for x0, x1, _ in ends_of(axes))
        assert edges == pytest.approx([np.degrees((0.02, 0.01)[axle])] * 2)
    slopes = [np.ptp(axes.lines[-1].get_ydata()) for axes in figure.axes[:2]]
    assert slopes[0] > 1.5 * slopes[1]


def test_the_learnt_axles_are_drawn_each_in_its_own_numbers():
    """Stiffness, relaxation length and saturation by hand, with the weights before each sample."""
    design, n = AxleIdentifier.for_vehicle(CAR), N + 1
    growth = np.linspace(0.5, 1.0, n)[:, None, None]
    W = growth * np.array([[0.2, 0.3, 0.2, 0.1], [0.1, 0.4, 0.1, 0.3]])
    own = growth * np.array([[0.03, 0.5, 0.0], [0.05, 0.2, 0.0]])
    history = replace(MADE, method=design, state={"W": W, "own": own})
    stiffness, lag, grip = learnt_axles_figure(history).axes
    for axle, load in enumerate(1500.0 * 9.81 / 2.7 * np.array([1.5, 1.2])):
        slope = (W[:-1, axle] / np.array(design.ladder)).sum(axis=1)
        for axes, values in (
            (stiffness, slope * load / 1e3),
            (lag, own[:-1, axle, 0] * slope + 1e-3 * 2.7),
            (grip, W[:-1, axle].sum(axis=1)),
        ):
            np.testing.assert_allclose(axes.lines[axle].get_ydata(), values, rtol=1e-6)


def test_the_band_is_drawn_around_the_curve_of_each_axle():
    model = unlike_axles()
    for axle, axes in enumerate(slip_figure(model, MADE.recording).axes[:2]):
        (band,) = [one for one in axes.collections if one.get_label() == "band of 90 %"]
        corners = np.array(band.get_paths()[0].vertices)
        slip = np.radians(np.unique(corners[:, 0])[20:-20:10])
        sides = [f[:, axle] / 1e3 for f in model.band.at(slip)]
        for at, low, high in zip(slip, *sides, strict=True):
            drawn = corners[np.isclose(np.radians(corners[:, 0]), at), 1]
            assert drawn.min() == pytest.approx(low) and drawn.max() == pytest.approx(high)


def test_slow_samples_are_left_out_of_the_slip_figure():
    history = MADE
    recording = replace(history.recording, v_x=np.where(np.arange(N) < 100, 0.1, 15.0))
    truth = slip_figure(history.freeze(22.0), recording).axes[0].lines[0]
    assert np.size(truth.get_xdata()) == N - 100
    with pytest.raises(ValueError, match="never reaches 1 m/s"):
        slip_figure(history.freeze(22.0), replace(recording, v_x=np.full(N, 0.1)))


def test_the_error_norm_is_the_euclidean_norm_and_bounds_far_above_make_its_axis_logarithmic():
    history = MADE
    axes = FIGURES["error"]().axes[0]
    expected = np.sqrt(np.sum(history.outputs["xi_tilde"] ** 2, axis=1))
    assert axes.lines[0].get_ydata() == pytest.approx(expected)
    assert axes.get_yscale() == "linear"
    assert FIGURES["error under bounds"]().axes[0].get_yscale() == "log"


def test_a_law_that_diverges_leaves_the_panel_instead_of_flattening_it():
    history = MADE
    force, xi_tilde = history.axle_force.copy(), history.outputs["xi_tilde"].copy()
    growth = np.exp(np.minimum(10.0 * np.arange(100), 700.0))[:, None]
    force[150:250] *= growth
    xi_tilde[150:250] *= growth
    force[250:], xi_tilde[250:] = np.nan, np.inf
    W = history.state["W"].copy()
    W[150:], W[250:] = 1e200, np.nan
    wild = replace(
        history,
        axle_force=force,
        outputs={**history.outputs, "xi_tilde": xi_tilde},
        state={**history.state, "W": W},
    )
    figure = force_figure(wild)
    assert figure.axes[0].get_ylim()[1] < 20.0
    assert figure.axes[0].get_title("right") == f"diverged at {wild.diverged_at:.4g} s"
    assert weights_figure(wild).axes[0].get_ylim()[1] < 1e3
    for drawn in (figure, error_figure(wild), weights_figure(wild)):
        assert figure_png(drawn)


def test_a_comparison_leaves_out_what_diverged_and_shows_the_paper_hollow():
    figure = comparison_figure({**RESULTS, "integral": {"online": (np.inf, 0.4, np.inf)}}, PAPER)
    assert figure_png(figure)
    hollow = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == "white"]
    assert [list(line.get_ydata()) for line in hollow] == [[0.3386]]
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == ["online", "32"]
    unstable = comparison_figure({**RESULTS, "instantaneous": {}}, PAPER)
    assert len(unstable.axes[0].containers) == 2


def test_a_comparison_draws_medians_with_quartiles_on_their_own_sides():
    results = {"integral": {"online": (0.5, 0.2, 1.1), "32": (0.4, 0.1, 0.6)}}
    axes = comparison_figure(results, {}).axes[0]
    (bars,) = axes.containers
    line, _, (whiskers,) = bars.lines
    assert list(line.get_ydata()) == [0.5, 0.4]
    spans = [tuple(segment[:, 1]) for segment in whiskers.get_segments()]
    assert spans == [pytest.approx((0.2, 1.1)), pytest.approx((0.1, 0.6))]


@pytest.mark.parametrize("truth", [True, False])
def test_below_the_forces_stands_what_is_missed_of_them(truth):
    history = MADE if truth else BLIND
    replays = frozen_replays(history)
    figure = force_figure(history, replays)
    known = history.recording.axle_force if truth else history.axle_force
    last = replays[22.0].axle_force
    for axle, axes in enumerate(figure.axes[-2:]):
        _, *lines = axes.lines
        drawn = {line.get_label(): line.get_ydata() for line in lines}
        expected = {"model": (last - known)[:, axle] / 1e3}
        if truth:
            expected["online"] = (history.axle_force - known)[:, axle] / 1e3
        assert drawn.keys() == expected.keys()
        for label, values in expected.items():
            np.testing.assert_allclose(drawn[label], values, atol=1e-12)


def test_below_the_curve_stands_what_the_model_misses_of_the_truth():
    history = MADE
    model = unlike_axles()
    figure = slip_figure(model, history.recording)
    missed = (model.predict(history.recording) - history.recording.axle_force) / 1e3
    for axle, axes in enumerate(figure.axes[2:]):
        _, cloud = axes.lines
        above = figure.axes[axle].lines[0]
        np.testing.assert_allclose(cloud.get_ydata(), missed[:, axle], atol=1e-9)
        np.testing.assert_allclose(cloud.get_xdata(), above.get_xdata())


def test_without_truth_both_figures_have_the_force_from_the_motion():
    over_slip = slip_figure(BLIND.freeze(22.0), BLIND.recording, WINDOWS)
    over_time = prediction_figure(replayed(BLIND), WINDOWS)
    for figure, at in ((over_slip, np.degrees(WINDOWS.slip)), (over_time, WINDOWS.t[:, None])):
        for axle, (above, below) in enumerate(zip(figure.axes[:2], figure.axes[2:], strict=True)):
            x, y = curves(above)["force from the motion"].T
            np.testing.assert_allclose(x, (at + np.zeros(2))[:, axle])
            np.testing.assert_allclose(1e3 * y, WINDOWS.measured[:, axle])
            missed = 1e3 * below.lines[1].get_ydata()
            np.testing.assert_allclose(missed, (WINDOWS.modelled - WINDOWS.measured)[:, axle])


def test_a_guessed_stiffness_is_not_drawn():
    guessed = replace(CAR, estimated=("cornering_stiffness_front",))
    figure = slip_figure(replace(unlike_axles(), vehicle=guessed), MADE.recording)
    assert ["linear tire" in curves(axes) for axes in figure.axes[:2]] == [False, True]


@pytest.mark.heavy
def test_times_of_a_clock_that_began_long_ago_fit_their_titles_and_axes():
    recording = MADE.recording
    history = replace(MADE, recording=replace(recording, t=recording.t + 1.7e9))
    figure = force_figure(history, {1.7e9 + 22.0: replayed(history)})
    assert not clipped(figure)
    assert figure.axes[2].get_title("left") == "Front axle, frozen at 22 s"
    assert figure.axes[-1].get_xlabel() == "time since 1700000000 s [s]"
    shown = [text.get_text() for text in figure.axes[-1].get_xticklabels()]
    assert {"20", "22"} <= {one.split(".")[0] for one in shown}


def test_a_tire_is_no_recording_to_plot():
    with pytest.raises(TypeError, match=r"recording must be a Recording, as of read_recording"):
        inputs_figure("tire")
