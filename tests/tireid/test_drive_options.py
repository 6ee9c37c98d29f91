"""How fast and on what road: words with units, and one clear line for what is no speed."""

import math
import re
from types import SimpleNamespace

import pytest

from models.faults import SensorFault
from tireid.cli import build_parser
from tireid.commands.drive import _parse_drop, _parse_speed, conditions_of, parse_fault
from tireid.driving.runs import _BacksOff
from tireid.driving.setup import SpeedWish


@pytest.mark.parametrize(
    ("text", "wish"),
    [
        ("tires", {"share": 0.82}),
        (" 70 %", {"share": 0.7}),
        ("0.4g", {"a_y": 0.4 * 9.81}),
        ("4m/s2", {"a_y": 4.0}),
        ("4 m/s²", {"a_y": 4.0}),
        ("17 m/s", {"speed": 17.0}),
        ("72km/h", {"speed": 20.0}),
    ],
)
def test_a_speed_is_what_the_tires_allow_or_has_a_unit(text, wish):
    ((name, value),) = wish.items()
    assert _parse_speed(text) == SpeedWish(**{name: pytest.approx(value, rel=1e-4)})


def test_a_drop_is_a_place_and_a_friction():
    assert _parse_drop("60:0.5") == (60.0, 0.5)


def test_a_fault_is_a_channel_a_kind_times_and_a_size():
    assert parse_fault("v_y:biased:3:inf:0.5") == SensorFault(
        channel="v_y", kind="biased", start=3.0, duration=math.inf, size=0.5
    )
    assert parse_fault("r:stuck:1:2").duration == 2.0


SPEED, DROP, FAULT = (
    ("--speed", _parse_speed),
    ("--mu-drop", _parse_drop),
    ("--fault", parse_fault),
)


@pytest.mark.parametrize(
    ("option", "text", "said"),
    [
        (SPEED, "17", "has no unit: write 17%, 17g or 17m/s"),
        (SPEED, "0.9", "has no unit: write 0.9%, 0.9g or 0.9m/s"),
        (SPEED, "g", "(tires, 70%, 0.4g, 17m/s), not 'g'"),
        (SPEED, "5g", "in m/s² must lie between 0.2 and 30, it is 49"),
        (SPEED, "fast", "not 'fast'"),
        (SPEED, "-5m/s", "not '-5m/s'"),
        (SPEED, "nan%", "not 'nan%'"),
        (SPEED, "1e", "not '1e'"),
        (SPEED, "300%", "in % must lie between 5 and 150, it is 300"),
        (SPEED, "1km/h", "in m/s must lie between 3 and 100, it is 0.27"),
        (DROP, "60", "wants S:MU"),
        (DROP, "60:", "wants S:MU"),
        (DROP, "a:0.5", "wants S:MU"),
        (DROP, "nan:0.5", "wants S:MU"),
        (DROP, "-1:0.5", "the place must not be negative, it is -1 m"),
        (DROP, "inf:0.5", "the place"),
        (DROP, "60:0", "must lie between 0.05 and 1.5, it is 0"),
        (FAULT, "v_y", "wants CHANNEL:KIND"),
        (FAULT, "v_y:biased:soon:1:2", "wants CHANNEL:KIND"),
        (FAULT, "v_y:biased:1:2:3:4", "wants CHANNEL:KIND"),
        (FAULT, "v_y:biased:1:2", "biased needs a size"),
        (FAULT, "v_z:zero:1:2", "channel must be one of"),
        (FAULT, "v_y:tired:1:2", "kind must be one of"),
        (FAULT, "v_y:zero:-1:2", "start must be"),
    ],
)
def test_what_is_no_such_word_is_refused_with_its_rule(option, text, said):
    word, parse = option
    with pytest.raises(ValueError, match=f"{word}.*{re.escape(said)}"):
        parse(text)


def test_caution_is_a_share_and_zero_by_default():
    def told(*words):
        return build_parser(["drive", *words]).parse_args(["drive", *words])

    assert conditions_of(told()).caution == 0.0
    assert conditions_of(told("--caution", "0.5")).caution == 0.5
    with pytest.raises(ValueError, match="caution must lie between 0 and 1, it is 2"):
        conditions_of(told("--caution", "2"))


def test_a_tracker_that_backs_off_is_noted_once():
    noted, said = _BacksOff(None), []
    for grip in (1.0, 0.95, 0.7, 0.68, 0.72, 0.9):
        said.append(noted.observe(None, SimpleNamespace(grip=grip)))
    assert said == [
        *(None, None, "plans with 0.70 of the grip"),
        *(None, None, "plans with 0.90 of the grip"),
    ]
