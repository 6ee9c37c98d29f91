"""Numbers as people read them: three digits, ± of one or two, one unit of stiffness."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from identifier.baselines.linear import LinearModel
from identifier.measured import NOT_IDENTIFIABLE, as_printed, stiffness_words, with_doubt
from models.vehicle import sedan


@pytest.mark.parametrize(
    ("value", "sd", "words"),
    [
        (0.886, 0.0604, "0.886 ± 0.060"), (127.04, 4.8, "127 ± 5"), (0.4437, 0.153, "0.44 ± 0.15"),
        (-0.00101, 0.0112, "-0.001 ± 0.011"), (-1e-9, 0.0112, "0.000 ± 0.011"),
        (127.04, 0.018, "127.04 ± 0.02"), (9.996, None, "10.0"), (126986.0, None, "127000"),
        (0.0, None, "0"), (float("nan"), 1.0, "nan"), (0.5, float("inf"), "0.500"),
    ],
)  # fmt: skip
def test_a_value_has_three_digits_and_none_that_its_doubt_hides(value, sd, words):
    assert with_doubt(value, sd) == words


def test_a_stiffness_is_printed_in_kilonewtons_of_a_car_and_in_newtons_of_a_model_of_one():
    C, sd = np.array([900.0, 1100.0]), np.array([18.0, 20.0])
    assert stiffness_words(C, sd) == "0.900 ± 0.018 / 1.10 ± 0.02 kN/rad"
    assert stiffness_words(C / 20.0) == "45.0 / 55.0 N/rad"
    small = replace(
        sedan(),
        **{"mass": 1.5, "yaw_inertia": 0.005, "l_f": 0.08, "l_r": 0.09, "chassis": None},
        **{"cornering_stiffness_front": 40.0, "cornering_stiffness_rear": 50.0},
    )
    model = LinearModel(vehicle=small, min_speed=0.5)
    assert "cornering stiffness [N/rad]" in model.summary() and " 40.0 " in model.summary()
    assert "lateral force [N]" in model._repr_html_()


def test_a_summary_says_what_the_model_misses_once_somebody_looked(tmp_path):
    run = ti.identify(ti.sample_recording(), ti.sedan())
    verdict, tire = run.verdict, run.tire
    assert tuple(tire.model_error) == verdict.model_error
    front, rear = (with_doubt(100.0 * share) for share in verdict.model_error)
    (line,) = (one for one in tire.summary().splitlines() if one.startswith("model error"))
    assert line.split()[-2:] == [front, rear]
    for number in as_printed(verdict.numbers):
        assert number.words in tire.summary()
    gentle = run.freeze(2.0)  # the sample has not turned by then
    assert f"({NOT_IDENTIFIABLE})" in gentle.summary()
    tire.save(tmp_path / "tire.json")
    assert ti.TireModel.load(tmp_path / "tire.json").summary() == tire.summary()
    assert run.freeze().model_error is None
    assert "\nmodel error" not in run.freeze().summary()
    for other in (tire.at_friction(0.5), tire.mounted_on(tire.vehicle)):
        assert other.model_error is None
