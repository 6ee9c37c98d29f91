"""Which column of a table is the time, or at which rate its rows were taken where none is."""

import datetime

import numpy as np
import pytest

from models.logs.door import open_log
from models.logs.log import RecordingError
from models.logs.stamps import nanoseconds
from models.recordings import LogMap, read_recording
from models.recordings.reader import with_columns
from tests.models.logs.conftest import channel_of, refusal

N = 300
T = 0.02 * np.arange(N)


def signals(t):
    wave = np.sin(t)
    return {"vx": 20.0 + wave, "vy": 0.1 * wave, "r": 0.3 * wave, "delta_f": 0.05 * wave}


SIGNALS = signals(T)
FIRST = datetime.datetime(2025, 4, 4, 18, 10, 23)


def at(t, form):
    when = FIRST + datetime.timedelta(seconds=float(t))
    return when.strftime(form.replace("%3", f"{when.microsecond // 1000:03d}"))


def written(path, columns, before=""):
    """A table of the signals behind some columns of text."""
    cells = [*columns.values(), *(map(repr, x.tolist()) for x in SIGNALS.values())]
    rows = [",".join([*columns, *SIGNALS]), *map(",".join, zip(*cells, strict=True))]
    path.write_text(before + "\n".join([*rows, ""]), encoding="utf-8")
    return path


def numbers(values, form="{:g}"):
    return [form.format(one) for one in values]


def refused(path, rule):
    with pytest.raises(RecordingError, match=rule):
        open_log(path).read(["vx"])


def steps(log, rate=50.0):
    (channel,) = log.read(["vx"])
    np.testing.assert_allclose(np.diff(channel.t), 1.0 / rate, rtol=1e-6)
    return channel


COUNTED = numbers(np.arange(N) + 1)


@pytest.mark.parametrize("name", ["loggingSample", "Index", "", "frame", "packet"])
def test_a_column_that_counts_rows_is_no_time(tmp_path, name):
    path = written(tmp_path / "log.csv", {name: COUNTED})
    refused(path, r"no column is a time .*counts samples.*--rate HZ")
    log = open_log(path, rate=50.0)
    steps(log)
    assert log.listed()[-1].rate == 50.0 and "time is even at 50 Hz, as given" in log.notes
    both = written(tmp_path / "both.csv", {name: COUNTED, "stamp": numbers(T)})
    steps(open_log(both))
    tens = written(tmp_path / "tens.csv", {"sample": numbers(10 * np.arange(N))})
    refused(tens, "'sample' counts samples")


# Columns of a time that does not rise as it should, and what is said of it.
TICKS = 20 * np.arange(N)
DEVIATING = 20.0 + 0.3 * np.sin(97.0 * TICKS)
CLOCKS = {
    "16 bits": ({"t [ms]": (TICKS + 64000) % 65536}, "begins again each 65.536 s"),
    "16 bits with sign": ({"t [ms]": (TICKS + 64000) % 65536 - 32768}, "again each 65.536 s"),
    "8 bits": ({"time_ms": TICKS % 256}, "begins again each 0.256 s"),
    "32 bits": ({"micros": (1000 * TICKS + 2**32 - 3000000) % 2**32}, "again each 4294.9673 s"),
    "second of the minute": ({"time [s]": (T + 57.3) % 60.0}, "begins again each 60 s"),
    "intervals": ({"dt [ms]": DEVIATING}, "it holds intervals, which are summed"),
    "intervals called time": ({"time": DEVIATING / 1e3}, "it holds intervals, which are summed"),
    "of a lap": ({"TIME [s]": T % 2.5, "TOTALTIME [s]": T + 9.0}, "'TIME [s]' does not rise"),
    "s called us": ({"t [us]": T}, "too short for us"),
    "us called ns": ({"t [ns]": 1000 * TICKS}, "too short for ns"),
}


@pytest.mark.parametrize("kind", CLOCKS)
def test_a_time_is_known_by_what_it_does(tmp_path, kind):
    columns, said = CLOCKS[kind]
    cells = {name: numbers(values, "{:.12g}") for name, values in columns.items()}
    log = open_log(written(tmp_path / "log.csv", cells), mend=True)
    (channel,) = log.read(["vx"])
    np.testing.assert_allclose(np.diff(channel.t), 0.02, rtol=0.02)
    np.testing.assert_array_equal(channel.values, SIGNALS["vx"])
    assert said in " ".join((*log.dialect, *log.notes))


@pytest.mark.parametrize("name", ["Distance", "Distance [m]", "Lap Distance", "odometer"])
def test_a_log_over_distance_is_refused_with_the_reason(tmp_path, name):
    path = written(tmp_path / "log.csv", {name: numbers(0.5 * np.arange(N))})
    rule = f"no column is a time: '{name[:4]}.*is a distance; export the log over time"
    refused(path, rule)


def test_of_several_columns_that_rise_evenly_none_is_taken(tmp_path):
    columns = {"alpha": numbers(0.02 * np.arange(N)), "gamma": numbers(0.5 * np.arange(N))}
    path = written(tmp_path / "log.csv", columns)
    refused(path, r"several columns rise evenly \(alpha, gamma\): declare")
    steps(open_log(path, clock="alpha"))


@pytest.mark.parametrize(
    "line",
    ['"Sample Rate","50.000","Hz","Duration","6.0"', "# fs = 50 Hz", "Sampling frequency: 50",
     "Sample Interval,0.02,s", "# dt: 20 ms", "Abtastrate;0.05 kHz", "rate: 50 Hz"],
)  # fmt: skip
def test_the_lines_above_a_table_tell_the_rate_where_no_column_is_a_time(tmp_path, line):
    log = open_log(written(tmp_path / "log.csv", {"Index": COUNTED}, before=line + "\n\n"))
    steps(log)
    assert log.notes == ("time is even at 50 Hz, as the lines above the table say",)
    timed = written(tmp_path / "timed.csv", {"Time": numbers(2 * T)}, before=line + "\n\n")
    steps(open_log(timed), 25.0)


MONTHS = ["%d-%b-%Y %H:%M:%S.%3", "%b %d, %Y %I:%M:%S.%3 %p", "%Y-%b-%d %H:%M:%S.%3",
          "%a %b %d %H:%M:%S.%3 GMT+02:00 %Y", "%d %B %Y %H:%M:%S.%3", "%d/%m/%Y %I:%M:%S.%3 PM",
          "%d-%b-%y %H:%M:%S.%3", "%A, %d. %B %Y %H:%M:%S.%3"]  # fmt: skip


@pytest.mark.parametrize("form", MONTHS)
def test_months_may_be_words_and_hours_those_of_a_watch(tmp_path, form):
    path = tmp_path / "log.csv"
    cells = [f'"{at(t, form)}"' for t in T]
    if "PM" in form:
        assert cells[0] == '"04/04/2025 06:10:23.000 PM"'
    steps(open_log(written(path, {"Device Time": cells})))


def test_dates_with_words_are_those_without():
    told = nanoseconds("2025-03-04 18:10:23.050")
    assert nanoseconds("4. Mär. 2025 18:10:23,050") == told
    assert nanoseconds("4 juillet 2025 18:10:23") == nanoseconds("2025-07-04 18:10:23")
    assert nanoseconds("Tue Mar 4 2025 6:10:23.05 PM") == told
    assert nanoseconds("4 mars 2025 18:10:23.05") == told
    for text in ("4. Xyz 2025", "Mar 41, 2025", "13:10:00 PM", "March", "-", "Mon"):
        assert nanoseconds(text) is None


def test_of_two_times_the_one_that_is_not_rounded_is_taken(tmp_path):
    columns = {
        "GPS Time": [at(t, "%a %b %d %H:%M:%S GMT+02:00 %Y") for t in T],
        "Device Time": [at(t, "%d-%b-%Y %H:%M:%S.%3") for t in T],
    }
    log = open_log(written(tmp_path / "log.csv", columns))
    assert log.clock.name == "Device Time"
    steps(log)


def test_stamps_that_jitter_beyond_each_other_are_even_and_lost_ones_stay_refused(tmp_path):
    rng = np.random.default_rng(2)
    ms = np.sort(np.round(20 * np.arange(N) + rng.uniform(-11, 11, N) + 50))
    log = open_log(written(tmp_path / "log.csv", {"time [ms]": numbers(ms)}))
    steps(log)
    assert "jitters" in log.notes[0]
    twice = 20.0 * np.arange(N)
    twice[100] = twice[99]
    refused(
        written(tmp_path / "twice.csv", {"time [ms]": numbers(twice)}), "a sample is there twice"
    )
    lost = np.delete(np.append(ms, ms[-1] + 20.0 * np.arange(1, 4)), [100, 101, 102])
    refused(written(tmp_path / "lost.csv", {"time [ms]": numbers(lost)}), r"twice|out of order")


@pytest.mark.parametrize("told", ["millis [ms]", "millis", "clock"])
def test_a_told_clock_may_have_a_unit_be_words_and_is_not_forgotten(tmp_path, told):
    cells = [at(t, "%d-%b-%Y %H:%M:%S.%3") for t in T] if told == "clock" else numbers(1000 * T)
    columns = {told.partition(" ")[0]: cells, "lap time": numbers(T % 2.0)}
    path = written(tmp_path / "log.csv", columns)
    given_map = with_columns(LogMap(), {"t": told})
    steps(given_map.opened(path))
    given_map.to_toml(tmp_path / "log.toml")
    again = LogMap.from_toml(tmp_path / "log.toml")
    assert again == given_map and read_recording(path, log_map=again).duration == pytest.approx(
        T[-1]
    )


def test_a_rate_is_kept_in_a_map_and_refused_where_samples_have_times(tmp_path):
    path = written(tmp_path / "log.csv", {"Index": COUNTED})
    LogMap(rate=50.0).to_toml(tmp_path / "log.toml")
    told = LogMap.from_toml(tmp_path / "log.toml")
    assert told.rate == 50.0 and read_recording(path, log_map=told).duration == pytest.approx(T[-1])
    arrays = read_recording(SIGNALS, log_map=told)
    assert arrays.duration == pytest.approx(T[-1])
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(RecordingError, match="rate must be positive and finite, in Hz"):
            LogMap(rate=wrong)
    with pytest.raises(RecordingError, match="give it or the channel of the clock"):
        LogMap(rate=50.0, clock="t")
    bus = tmp_path / "bus.log"
    bus.write_text("(1.0) can0 123#0102\n" * 9)
    with pytest.raises(RecordingError, match="have times of their own, leave out the rate"):
        open_log(bus, rate=50.0)


@pytest.mark.parametrize("told", ["user", "fs", "dt"])
@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_arrays_without_a_time_have_a_rate(tmp_path, ending, told):
    pytest.importorskip("scipy")
    path = tmp_path / f"log.{ending}"
    more = {"user": {}, "fs": {"fs": 50.0}, "dt": {"dt": 0.02}}[told]
    if ending == "npz":
        np.savez(path, **SIGNALS, **more)
    else:
        from scipy.io import savemat

        savemat(path, {**SIGNALS, **more})
    rate = 50.0 if told == "user" else 0.0
    steps(open_log(path, rate=rate))
    if told == "user":
        assert "there is no vector t or time" in refusal(path)


def test_arrays_of_numpy_are_read_with_their_time_and_never_run(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", t=T, **SIGNALS, words=np.array("car"))
    log = open_log(tmp_path / "a.npz")
    assert [one.name for one in log.listed()] == list(SIGNALS) and log.format == "NumPy"
    np.testing.assert_array_equal(channel_of(log, "vy").values, SIGNALS["vy"])
    assert read_recording(tmp_path / "a.npz").name == "a"
    table = np.rec.fromarrays([T, *SIGNALS.values()], names=["t", *SIGNALS])
    np.save(tmp_path / "b.npy", table)
    steps(open_log(tmp_path / "b.npy"))
    np.savez(tmp_path / "c.npz", t=T, x=np.array([{}] * N, dtype=object))
    assert "x (no numbers)" in refusal(tmp_path / "c.npz")
    whole = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "d.npz").write_bytes(whole[: len(whole) // 2])
    refusal(tmp_path / "d.npz")
