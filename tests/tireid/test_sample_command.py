"""`tireid sample`: the log that it writes is the drive of the library, and can be learnt from."""

import numpy as np
import pytest

import tireid as ti
from tests.tireid.conftest import typed


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sample")
    assert typed("sample", folder / "log.csv", "--car", folder / "car.toml") == 0
    return folder


def test_the_log_reads_back_as_the_recording_that_was_driven(written):
    read, driven = ti.read_recording(written / "log.csv"), ti.sample_recording()
    for name in ("t", "v_x", "v_y", "r", "delta_f", "delta_r", "axle_force"):
        assert np.array_equal(getattr(read, name), getattr(driven, name)), name


def test_the_car_is_the_one_that_drove_and_both_can_be_learnt_from(written):
    car, log = ti.Vehicle.from_toml(written / "car.toml"), ti.read_recording(written / "log.csv")
    assert car == ti.sedan()
    missed = ti.replay(ti.sample_recording(car, seed=1), ti.identify(log, car).freeze())
    assert missed.against_truth.front < 0.1 * missed.true_force.front
    assert missed.against_truth.rear < 0.1 * missed.true_force.rear


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["log.txt"], ".csv"),
        (["log.csv"], "exists: choose another, or add --force"),
        (["new.csv", "--car", "car.toml"], "car.toml exists: choose another, or add --force"),
        (["new.csv", "--seed", "-1"], "--seed must not be negative"),
    ],
)
def test_what_cannot_be_written_is_refused_before_it_is_driven(
    written, words, said, capsys, monkeypatch
):
    monkeypatch.chdir(written)
    before = (written / "log.csv").read_bytes()
    assert typed("sample", *words) == 2
    assert said in capsys.readouterr().err
    assert (written / "log.csv").read_bytes() == before
    assert not (written / "new.csv").exists()


def test_another_seed_is_another_drive(written, tmp_path):
    assert typed("sample", tmp_path / "log.csv.gz", "--seed", "1") == 0
    other, log = ti.read_recording(tmp_path / "log.csv.gz"), ti.read_recording(written / "log.csv")
    assert not np.array_equal(other.v_y, log.v_y)
