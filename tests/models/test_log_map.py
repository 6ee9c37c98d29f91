"""The map of a log: log.toml and back bit for bit, words of a command line, and what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.logs.log import RecordingError
from models.logs.signals import QUANTITIES, Signal
from models.recordings import LogMap, Repair
from models.recordings.map import given_signals
from models.recordings.wheels import DRIVEN, Wheels
from tests.refused import line_about

finite = st.floats(-1e6, 1e6, allow_nan=False)
factors = finite.filter(bool)
positive = st.floats(1e-3, 1e3)
names = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=12)


@st.composite
def signals(draw):
    found = {}
    chosen = draw(st.sets(st.sampled_from(["v_x", "r", "delta_f", "a_y", "v_y", "wheel_rl"])))
    for name in sorted(chosen):
        steers = name == "delta_f"
        table = draw(st.booleans()) if steers else False
        found[name] = Signal(
            channel=tuple(draw(st.lists(names, min_size=1, max_size=3, unique=True))),
            unit=draw(st.sampled_from(["", "deg"])) if steers else "",
            factor=draw(factors),
            offset=draw(finite),
            ratio=draw(positive) if steers and not table else 1.0,
            table=((-1.0, -draw(positive)), (0.0, 0.0), (2.0, draw(positive))) if table else (),
        )
    return found


@settings(max_examples=100, deadline=None)
@given(
    told=signals(),
    axes=st.sampled_from(["ISO", "SAE"]),
    words=st.lists(names, min_size=2, max_size=2, unique=True),
    gap=positive,
    low_pass=st.none() | positive,
    wheels=st.builds(
        Wheels,
        radius=st.sampled_from([(), (0.31,), (0.3, 0.32), (0.3, 0.31, 0.32, 0.33)]),
        track=st.sampled_from([(), (1.5,), (1.5, 1.6)]),
        wheelbase=st.none() | st.floats(1.0, 9.0),
        driven=st.sampled_from(["", *DRIVEN]),
        acceleration=st.floats(1.0, 50.0),
    ),
    repair=st.builds(
        Repair,
        factor=st.dictionaries(st.sampled_from(["r", "v_y"]), factors),
        delay=st.dictionaries(st.sampled_from(["r", "delta_f"]), finite),
        velocity_sensor_x=finite,
        vehicle=st.dictionaries(st.sampled_from(["mass", "l_f"]), positive),
    ),
)
def test_what_is_written_reads_back_bit_for_bit(
    tmp_path_factory, told, axes, words, gap, low_pass, wheels, repair
):
    made = LogMap(
        signals=told,
        axes=axes,
        run=words[0],
        clock=words[1],
        longest_gap=gap,
        holes="cut" if gap > 1.0 else "refuse",
        order="mend" if gap < 2.0 else "refuse",
        low_pass=low_pass,
        packet="<d2f" if gap > 1.0 else "",
        fields=("t".join(words), *words) if gap > 1.0 else (),
        wheels=wheels,
        repair=repair,
    )
    path = tmp_path_factory.mktemp("map") / "log.toml"
    made.to_toml(path)
    again = LogMap.from_toml(path)
    assert again == made and again.toml() == made.toml()


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        (
            "[files]\n",
            "files is unknown, known are file, clock, filters, packet, signals, wheels, repair",
        ),
        ("[file]\naxis = 'ISO'\n", "file.axis is unknown, known are axes, run, dbc"),
        ("[file]\naxes = 'NED'\n", "axes must be one of ISO, SAE, not 'NED'"),
        ("[signals.vy]\nchannel = 'a'\n", "signals.vy is unknown, known are v_x, v_y, beta"),
        ("[signals.v_y]\nunit = 'm/s'\n", "signals.v_y.channel is missing"),
        ("[signals.v_y]\nchannel = 3\n", "channel must be a text or a list of texts, it is 3"),
        ("[signals.v_y]\nchannel = [3]\n", "a text or a list of texts, it is a list of 1"),
        ("[signals.v_y]\nchannel = []\n", "signals.v_y: channel must name at least one"),
        ("[signals.v_y]\nchannel = ['a', 'a']\n", "signals.v_y: channel must name each once"),
        ("[signals.v_y]\nchannel = 'a'\nscale = 2\n", "signals.v_y.scale is unknown"),
        ("[signals.v_y]\nchannel = 'a'\nfactor = 0\n", "factor must be finite and not zero"),
        ("[signals.v_y]\nchannel = 'a'\nfactor = '2'\n", "factor must be a number"),
        ("[signals.v_y]\nchannel = 'a'\noffset = nan\n", "offset must be finite, it is nan"),
        ("[signals.v_y]\nchannel = 'a'\nratio = 2\n", "signals.v_y can have no ratio or table"),
        ("[signals.v_y]\nchannel = 'a'\nunit = 'deg'\n", "'deg' is one of an angle"),
        ("[signals.delta_f]\nchannel = 'a'\nratio = -1e4\n", "ratio must be hand wheel over road"),
        ("[signals.delta_f]\nchannel = 'a'\nratio = 2\ntable = [[0, 0], [1, 1]]\n", "give one of"),
        ("[signals.delta_f]\nchannel = 'a'\ntable = [[0, 0], [1, -1]]\n", "that rise"),
        *(
            (
                f"[signals.delta_f]\nchannel = 'a'\ntable = {pairs}\n",
                f"table must be pairs [hand wheel, road wheel] in rad, it is {shown}",
            )
            for pairs, shown in (
                ("[1.0, 2.0]", "a list of 2"),
                ("[[0, 0, 0], [1, 1, 1]]", "a list of 2"),
                ("[['a', 0], [1, 1]]", "a list of 2"),
                ("3", "3"),
                ("{}", "a table of 0"),
                ("[]", "empty"),
            )
        ),
        ("[wheels]\nradius = [[0.3]]\n", "radius must be a number or a list of numbers, it is a"),
        ("[wheels]\ndriven = 'left'\n", "driven must be one of front, rear, all, none"),
        ("[wheels]\nradii = 0.3\n", "wheels.radii is unknown, known are radius, track, wheelbase"),
        ("[wheels]\ntrack = 'a'\n", "wheels.track must be a number or a list of numbers, it is"),
        ("[signals.v_y]\nchannel='a'\n[signals.beta]\nchannel='b'\n", "beta replaces v_y"),
        ("[signals.Fyf]\nchannel='a'\n", "Fyf needs its partner"),
        ("[clock]\nlongest_gap = -1\n", "longest_gap must be positive and finite, it is -1"),
        ("[packet]\nformat = '<q'\n", "packet.fields must name each of the 1 numbers"),
        ("[packet]\nfields = ['a']\n", "packet.format must hold numbers alone, as Python's struct"),
        ("[packet]\nformat = '<4s'\nfields = ['a']\n", "packet.format must hold numbers alone"),
        ("[packet]\nformat = '<99999999d'\nfields = ['a']\n", "in at most 65536 bytes, not '<9999"),
        (
            "[packet]\nformat = '<2d'\nfields = ['a', 'a']\n",
            "packet.fields must name each of the 2",
        ),
        ("[filters]\nlow_pass = 0\n", "low_pass must be positive and finite, it is 0"),
        ("[repair]\nmass = 1\n", "repair.mass is unknown"),
        ("[repair.vehicle]\nmass = -1\n", "vehicle.mass must be positive"),
        ("run = 3", "run is unknown"),
        ("[file", "cannot be read as TOML"),
    ],
)
def test_what_is_no_map_is_refused_in_one_line(tmp_path, text, rule):
    path = tmp_path / "log.toml"
    path.write_text(text)
    assert rule in line_about(path, RecordingError, LogMap.from_toml)


@pytest.mark.parametrize(
    ("word", "name", "signal"),
    [
        ("r=yaw_rate", "r", Signal(channel=("yaw_rate",))),
        ("vy=Vel Lat [km/h]", "v_y", Signal(channel=("Vel Lat",), unit="km/h")),
        ("v_y = Vel Lat  [m/s]", "v_y", Signal(channel=("Vel Lat",), unit="m/s")),
        (
            "delta_f=SteerAngle [deg] /14.6",
            "delta_f",
            Signal(channel=("SteerAngle",), unit="deg", ratio=14.6),
        ),
        ("r=Gyro Z [deg/s] *-1", "r", Signal(channel=("Gyro Z",), unit="deg/s", factor=-1.0)),
        ("ay=a *2 -0.3", "a_y", Signal(channel=("a",), factor=2.0, offset=0.3)),
        ("delta_f=FL + FR", "delta_f", Signal(channel=("FL", "FR"))),
        ("delta_f=FL+FR", "delta_f", Signal(channel=("FL+FR",))),
        ("r=/imu.angular_velocity.z", "r", Signal(channel=("/imu.angular_velocity.z",))),
        ("beta=Slip-Angle", "beta", Signal(channel=("Slip-Angle",))),
    ],
)
def test_a_word_of_the_command_line_tells_a_signal(word, name, signal):
    assert given_signals([word]) == {name: signal}


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (["rate=yaw_rate"], "'rate' is no column of ours: t, vx, vy"),
        (["r"], "wants"),
        (["r="], "wants"),
        (["r=a", "r=b"], "gives r twice"),
        (["r=a *1 *2"], "gives the factor of"),
        (["vy=a /3"], "signals.v_y can have no ratio"),
        (["vy=a", "beta=b"], "beta replaces v_y"),
        (["r=a *0"], "factor must be finite and not zero"),
    ],
)
def test_a_word_that_tells_none_is_refused(words, rule):
    with pytest.raises(RecordingError, match=re.escape(rule)):
        given_signals(words)


def test_what_is_told_later_replaces_and_sideslip_takes_the_place_of_lateral_velocity():
    first = LogMap(signals=given_signals(["vy=a", "r=b"]))
    second = first.with_signals(given_signals(["beta=c", "r=d"]))
    assert set(second.signals) == {"beta", "r"} and second.signals["r"].channel == ("d",)
    assert set(second.with_signals(given_signals(["vy=e"])).signals) == {"v_y", "r"}
    assert not first.is_complete
    assert first.with_signals(given_signals(["vx=u", "delta_f=s"])).is_complete


def test_a_hand_wheel_becomes_road_wheels_by_ratio_or_table():
    hand = np.array([-4.0, -1.0, 0.0, 1.0, 3.0])
    assert np.allclose(Signal(channel=("a",), ratio=16.0).value([hand], "angle"), hand / 16.0)
    table = ((-2.0, -0.2), (0.0, 0.0), (2.0, 0.1))
    road = Signal(channel=("a",), table=table).value([hand], "angle")
    assert np.allclose(road, [-0.4, -0.1, 0.0, 0.05, 0.15])


def test_of_several_channels_forces_are_added_and_angles_averaged():
    left, right = np.array([1.0, 2.0]), np.array([3.0, 6.0])
    both = Signal(channel=("l", "r"), factor=2.0, offset=1.0)
    assert both.value([left, right], QUANTITIES["Fyf"]).tolist() == [7.0, 15.0]
    assert both.value([left, right], QUANTITIES["delta_f"]).tolist() == [3.0, 7.0]
    assert replace(both, factor=-1.0, offset=0.0).value([left, right], "angle").tolist() == [-2, -4]
