"""How far work has come: a line that changes on a terminal, lines elsewhere, none on stdout."""

import io

import pytest

from tireid import progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """A clock that is put forward by hand."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(progress, "_listening", True)
    monkeypatch.setattr(progress, "_live", False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")
    return now


def stream(monkeypatch, kind):
    err, out = kind(), io.StringIO()
    monkeypatch.setattr(progress.sys, "stderr", err)
    monkeypatch.setattr(progress.sys, "stdout", out)
    return err, out


def worked(clock, seconds=10, parts=None):
    with progress.Progress("work", parts) as work:
        for quarter in range(1, 4 * seconds + 1):
            clock[0] += 0.25
            work(quarter / (4 * seconds))


def seen(text):
    """What a terminal shows at the end: each wipe begins the line anew."""
    return [line.rpartition("\r\x1b[K")[2] for line in text.split("\n")]


def test_on_a_terminal_one_line_changes_and_goes_away(clock, monkeypatch):
    err, out = stream(monkeypatch, Terminal)
    worked(clock)
    text = err.getvalue()
    assert "\n" not in text
    assert seen(text) == [""]
    assert "work: 50 %, 5 s left" in text
    assert text.count("work: ") == 33  # from 2 s on
    assert out.getvalue() == ""


def test_elsewhere_it_is_a_plain_line_now_and_then(clock, monkeypatch):
    err, out = stream(monkeypatch, io.StringIO)
    worked(clock, seconds=20)
    lines = err.getvalue().splitlines()
    assert lines[0] == "  work: 10 %, 18 s left"
    assert len(lines) == 4
    assert "\r" not in err.getvalue() and "\x1b" not in err.getvalue()
    assert out.getvalue() == ""


@pytest.mark.parametrize("kind", [Terminal, io.StringIO])
def test_short_work_says_nothing(clock, monkeypatch, kind):
    err, _ = stream(monkeypatch, kind)
    worked(clock, seconds=1)
    assert err.getvalue() == ""


def test_a_program_that_uses_the_library_hears_nothing(clock, monkeypatch):
    monkeypatch.setattr(progress, "_listening", False)
    err, _ = stream(monkeypatch, Terminal)
    worked(clock)
    assert err.getvalue() == ""


def test_a_message_and_a_result_take_the_line_away_before_they_are_printed(clock, monkeypatch):
    err, out = stream(monkeypatch, Terminal)
    with progress.Progress("work") as work:
        clock[0] += 3.0
        work(0.5)
        progress.say("something happened")
        clock[0] += 1.0
        work(0.6)
        progress.tell("a result")
    assert seen(err.getvalue()) == ["  something happened", ""]
    assert out.getvalue() == "a result\n"


def test_parts_count_by_how_long_they_last(clock, monkeypatch):
    err, _ = stream(monkeypatch, io.StringIO)
    with progress.Progress("work", {"first": 1.0, "second": 3.0}, long=True) as work:
        clock[0] += 10.0
        work(1.0)
        work.begin("second")
        for _ in range(3):
            clock[0] += 10.0
            work.step(3)
    assert err.getvalue().splitlines() == [
        "  work: first, 0 %",
        "  work: first, 25 %, 30 s left",
        "  work: second, 25 %, 30 s left",
        "  work: second, 50 %, 20 s left",
        "  work: second, 75 %, 10 s left",
        "  work: second, 100 %, 0 s left",
    ]


def test_what_a_file_is_called_neither_commands_the_terminal_nor_breaks_the_line(
    clock, monkeypatch
):
    err, _ = stream(monkeypatch, Terminal)
    with progress.Progress("a\x1b[2J\nb" + "x" * 200) as work:
        clock[0] += 3.0
        work(0.5)
    text = err.getvalue()
    assert text.replace("\r\x1b[K", "").isprintable()
    assert len(text.replace("\r\x1b[K", "")) < 60


def test_a_standard_error_that_is_closed_stops_nothing(clock, monkeypatch):
    monkeypatch.setattr(progress.sys, "stderr", None)
    worked(clock)
