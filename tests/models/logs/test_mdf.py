"""MDF files: groups of their own rates, conversions, invalid samples; nothing is executed."""

import warnings

import numpy as np
import pytest

from models.logs import mdf
from models.logs.door import open_log
from tests.models.logs.conftest import channel_of, refusal

asammdf = pytest.importorskip("asammdf")
T = np.arange(600) / 100
SLOW, SLOWEST = T[::2], T[::10]
A = np.random.default_rng(5).standard_normal(600)
RAW = (np.arange(300) % 90).astype("i2")


def write(path, *groups, version="4.10", compression=2):
    """Groups of (comment, signals)."""
    path = path.with_suffix(".mf4" if version >= "4" else ".mdf")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with asammdf.MDF(version=version) as file:
            for comment, signals in groups:
                file.append(list(signals), comment=comment, common_timebase=True)
            file.save(path, overwrite=True, compression=compression if version >= "4" else 0)
    return path


def signal(name, values, t, unit="", **more):
    return asammdf.Signal(values, t, name=name, unit=unit, **more)


def opened(tmp_path, *signals, **how):
    """The log of one group."""
    return open_log(write(tmp_path / "log.mf4", ("g", signals), **how))


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_groups_have_their_own_rates_and_a_name_in_two_of_them_tells_the_group(version, tmp_path):
    gap = np.concatenate([SLOW[:100], SLOW[150:]])
    path = write(
        tmp_path / "log.mf4",
        ("imu", [signal("ay", A, T, "g"), signal("v", A * 2, T, "m/s")]),
        ("gps", [signal("v", A[: gap.size], gap, "km/h")]),
        ("wheel", [signal("steer", A[:60], SLOWEST, "deg")]),
        version=version,
    )
    log = open_log(path)
    listed = {one.name: (one.unit, one.samples, round(one.rate)) for one in log.listed()}
    assert listed == {
        "ay": ("g", 600, 100),
        "imu/v": ("m/s", 600, 100),
        "gps/v": ("km/h", 250, 50),
        "steer": ("deg", 60, 10),
    }
    steer, ay, v = log.read(["steer", "ay", "gps/v"])
    assert np.array_equal(steer.t, SLOWEST) and np.array_equal(steer.values, A[:60])
    assert np.array_equal(ay.t, T) and np.array_equal(ay.values, A)
    assert np.array_equal(v.t, gap)  # a gap stays one


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_conversions_are_applied_as_the_file_tells_them(version, tmp_path):
    linear = {"a": 0.01, "b": -1.0}
    table = {f"raw_{k}": float(k) for k in range(4)} | {f"phys_{k}": float(k**2) for k in range(4)}
    table |= {"interpolation": True}
    path = write(
        tmp_path / "log.mf4",
        ("g", [signal("linear", RAW, SLOW, "deg", conversion=linear)]),
        ("h", [signal("table", (RAW % 4).astype("u1"), SLOW, conversion=table)]),
        version=version,
    )
    one, two = open_log(path).read(["linear", "table"])
    assert np.allclose(one.values, RAW * 0.01 - 1.0, rtol=0, atol=1e-12)
    assert np.array_equal(two.values, (RAW % 4) ** 2.0)


def test_a_formula_is_computed(tmp_path):
    formula = {"formula": "sin(X) * 2.5e-1 + X / 4"}
    (f,) = opened(tmp_path, signal("f", A, T, conversion=formula)).read(["f"])
    assert np.allclose(f.values, np.sin(A) * 0.25 + A / 4)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('pathlib').Path('{}').touch() or X",
        "X.__class__",
        "(lambda: X)()",
        "[X for X in (1,)]",
        "sin.__call__(X)",
    ],
)
def test_a_formula_that_is_code_is_not_executed(text, tmp_path):
    mark = tmp_path / "executed"
    formula = {"formula": text.format(mark)}
    log = opened(tmp_path, signal("f", A, T, conversion=formula), signal("a", A, T))
    assert [one.name for one in log.listed()] == ["a"]
    assert (
        log.notes[0].startswith("a conversion must be a formula of numbers") and "f" in log.notes[0]
    )
    log.read(["a"])
    assert not mark.exists()


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_enumerations_and_texts_are_left_out_and_named(version, tmp_path):
    words = {"val_0": 0, "text_0": "park", "val_1": 1, "text_1": "drive", "default": "?"}
    gear = signal("gear", (np.arange(600) % 2).astype("u1"), T, conversion=words)
    name = signal("driver", np.array([b"somebody"] * 600), T, encoding="utf-8")
    log = opened(tmp_path, gear, name, signal("a", A, T), version=version)
    assert [one.name for one in log.listed()] == ["a"]
    assert log.notes == ("enumerations and texts are no signals: gear, driver",)


def test_a_state_named_among_numbers_is_nan(tmp_path):
    """As "not available" in a signal that is a number else."""
    block = asammdf.blocks.v4_blocks.ChannelConversion
    conversion = block(
        conversion_type=8, default_addr=0, links_nr=6, ref_param_nr=2, val_param_nr=2,
        lower_0=89.0, upper_0=89.0, text_0=b"SNA",
    )  # fmt: skip
    conversion.referenced_blocks["default_addr"] = block(conversion_type=1, a=0.5, b=1.0)
    log = opened(tmp_path, signal("v", RAW, SLOW, conversion=conversion))
    assert [one.name for one in log.listed()] == ["v"]
    expected = np.where(RAW == 89, np.nan, RAW * 0.5 + 1.0)
    assert np.array_equal(channel_of(log, "v").values, expected, equal_nan=True)


def test_samples_that_the_logger_marked_invalid_are_nan(tmp_path):
    invalid = np.arange(600) % 7 == 0
    log = opened(tmp_path, signal("a", A, T, invalidation_bits=invalid), signal("b", A, T))
    a, b = log.read(["a", "b"])
    assert np.array_equal(a.values, np.where(invalid, np.nan, A), equal_nan=True)
    assert np.array_equal(b.values, A)
    assert np.array_equal(a.t, T)


def test_many_channels_are_read_in_portions_of_the_memory(tmp_path, monkeypatch):
    log = opened(tmp_path, *(signal(f"s{k}", A + k, T) for k in range(9)))
    monkeypatch.setattr(mdf, "_NUMBERS_AT_ONCE", 1500)
    read = log.read([f"s{k}" for k in (8, 1, 4, 0)])
    for k, channel in zip((8, 1, 4, 0), read, strict=True):
        assert np.array_equal(channel.values, A + k)


def test_a_group_whose_master_is_no_time_is_left_out(tmp_path):
    path = write(tmp_path / "log.mf4", ("g", [signal("a", A, T)]), compression=0)
    with asammdf.MDF(path) as file:
        master = file.groups[0].channels[0]
        place = master.address + 24 + 8 * master.links_nr + 1  # sync_type, after the type
    data = bytearray(path.read_bytes())
    assert data[place] == 1
    data[place] = 2  # an angle
    path.write_bytes(data)
    assert refusal(path).endswith(
        "holds no numeric channel with a time; there is no time beside: a"
    )


def test_a_block_that_inflates_beyond_the_limit_is_refused(tmp_path, monkeypatch):
    path = write(tmp_path / "log.mf4", ("g", [signal("a", np.zeros(200_000), np.arange(2e5))]))
    monkeypatch.setenv("TIREID_LIMITS", "block=1.7")
    assert "megabytes of a block must be at most 1.7" in refusal(path)


def altered(tmp_path, change):
    """A file whose first channel's block is changed by (data, its address)."""
    path = write(tmp_path / "log.mf4", ("g", [signal("a", A, T), signal("b", A, T)]), compression=0)
    with asammdf.MDF(path) as file:
        group = file.groups[0]
        places = group.channels[1].address, group.channel_group.address
    data = bytearray(path.read_bytes())
    change(data, *places)
    path.write_bytes(data)
    return refusal(path)


def put(data, place, number, size):
    data[place : place + size] = number.to_bytes(size, "little")


def test_lists_of_channels_that_run_in_a_circle_are_refused(tmp_path):
    text = altered(tmp_path, lambda data, channel, _: put(data, channel + 24, channel, 8))
    assert "its blocks run in a circle" in text


def test_a_channel_beyond_its_record_is_refused(tmp_path):
    def move(data, channel, _):
        put(data, channel + 24 + 8 * 8 + 4, 10_000, 4)  # its byte in the record

    assert "a channel lies beyond its record of 24 bytes" in altered(tmp_path, move)


def test_records_that_are_not_there_are_refused(tmp_path):
    def add(data, _, group):
        put(data, group + 24 + 6 * 8 + 8, 601, 8)  # how many there are

    assert "is a cut off MDF file, it holds 14400 bytes of 601 records of 24" in altered(
        tmp_path, add
    )
