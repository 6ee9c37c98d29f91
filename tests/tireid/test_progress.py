"""How far work has come: a line now and then, none on standard output."""

import pytest

from tireid import progress


@pytest.fixture
def clock(monkeypatch):
    """A clock that is put forward by hand."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(progress, "_listening", True)
    return now


def worked(clock, seconds=10):
    work = progress.Progress("work")
    for quarter in range(1, 4 * seconds + 1):
        clock[0] += 0.25
        work(quarter / (4 * seconds))


def test_it_is_a_plain_line_now_and_then(clock, capsys):
    worked(clock, seconds=20)
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert lines[0] == "  work: 10 %, 18 s left"
    assert len(lines) == 4
    assert "\r" not in err and "\x1b" not in err and out == ""


def test_short_work_says_nothing(clock, capsys):
    worked(clock, seconds=1)
    assert capsys.readouterr().err == ""


def test_a_program_that_uses_the_library_hears_nothing(clock, monkeypatch, capsys):
    monkeypatch.setattr(progress, "_listening", False)
    worked(clock)
    assert capsys.readouterr().err == ""


def test_parts_count_by_how_long_they_last(clock, capsys):
    work = progress.Progress("work", {"first": 10.0, "second": 30.0}, long=True)
    clock[0] += 10.0
    work(1.0)
    work.begin("second")
    for _ in range(3):
        clock[0] += 10.0
        work.step(3)
    assert capsys.readouterr().err.splitlines() == [
        "  work: first, 0 %",
        "  work: first, 25 %, 30 s left",
        "  work: second, 25 %, 30 s left",
        "  work: second, 50 %, 20 s left",
        "  work: second, 75 %, 10 s left",
        "  work: second, 100 %, 0 s left",
    ]


def test_the_time_left_leaves_out_what_comes_before_the_first_share(clock, capsys):
    """The first share comes after 20 s of compiling; the log is long, what follows it is short."""
    work = progress.Progress("work", {"learning": 0.2, "figures": 2.0})
    clock[0] += 20.0
    for share in range(1, 41):
        clock[0] += 1.0
        work(share / 40)
    work.begin("figures")
    said = capsys.readouterr().err.splitlines()
    left = [int(line.split(", ")[-1].split()[0]) for line in said if "left" in line]
    assert "left" not in said[0] and len(left) > 5
    assert all(abs(one - (42 - 5 * (k + 1))) <= 1 for k, one in enumerate(left[:-1])), left
    assert "min" not in " ".join(said)


def test_what_a_file_is_called_neither_commands_the_terminal_nor_breaks_the_line(clock, capsys):
    work = progress.Progress("a\x1b[2J\nb")
    clock[0] += 3.0
    work(0.5)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.isprintable()


def test_a_standard_error_that_is_closed_stops_nothing(clock, monkeypatch):
    monkeypatch.setattr(progress.sys, "stderr", None)
    worked(clock)
