"""The command line itself: one-line errors, exit codes, help."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tireid.conftest import typed
from tireid.cli import build_parser, one_line
from tireid.commands import COMMANDS
from tireid.commands.options import method_name


@pytest.mark.parametrize(
    "words",
    [["fly"], ["identify"], ["identify", "log.csv"], ["paper", "--seeds", "many"]],
)
def test_wrong_words_are_one_line_with_exit_code_2(capsys, words):
    with pytest.raises(SystemExit) as stop:
        typed(*words)
    assert stop.value.code == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert "error:" in said[0]


def test_without_a_word_it_tells_what_there_is(capsys):
    assert typed() == 0
    alone = capsys.readouterr().out
    with pytest.raises(SystemExit):
        typed("--help")
    assert alone == capsys.readouterr().out


def helps(parser):
    """The help of a parser and of all of its commands."""
    yield parser.format_help()
    for action in parser._subparsers._group_actions if parser._subparsers else ():
        for one in action.choices.values():
            yield from helps(one)


def test_no_help_shows_the_percent_signs_of_its_source():
    told = [text for name in COMMANDS for text in helps(build_parser([name]))]
    assert len(told) > len(COMMANDS)
    for text in told:
        assert "%%" not in text, text


def options_of():
    """Every option of every command, by its word."""
    found = {}
    for name in COMMANDS:
        parser = build_parser([name])
        choices = next(a for a in parser._actions if a.choices and name in a.choices).choices
        for action in choices[name]._actions:
            for word in action.option_strings:
                found.setdefault(word, {})[name] = action
    return found


def test_an_option_takes_the_same_in_every_command():
    for word, actions in options_of().items():
        kinds = {(type(a).__name__, a.type) for a in actions.values() if word != "--method"}
        kinds -= {("_StoreAction", None)}  # words that the command reads itself
        assert len(kinds) <= 1, (word, actions)


def test_folders_are_named_by_out_and_nothing_is_replaced_without_force():
    options = options_of()
    for name, action in options["--out"].items():
        asked = name in ("check", "doctor", "emit")
        assert action.default == (None if asked else Path(f"tireid-{name}"))
        assert not action.required
        assert name in options["--force"]
    assert set(COMMANDS) - set(options["--out"]) == {"channels", "init", "live", "sample"}  # files


def test_what_learns_is_named_alike_wherever_one_method_learns():
    options = options_of()
    for name in ("identify", "check", "export", "drive"):
        assert {name} <= set(options["--paper"]) & set(options["--design"])
        assert options["--method"][name].type is method_name
    assert set(options["--method"]) == {"identify", "check", "export", "drive", "compare"}


def test_an_error_of_the_system_names_the_file():
    with pytest.raises(OSError) as caught:
        open("/nowhere/at/all.toml")  # noqa: PTH123, SIM115 - the message of open is the subject
    assert one_line(caught.value) == "/nowhere/at/all.toml: no such file or directory"


def test_an_interruption_is_said_and_leaves_nothing(monkeypatch, capsys, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("tireid.commands.paper.run_study", interrupted)
    assert typed("paper", "--out", tmp_path / "out") == 130
    assert "interrupted" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_an_output_folder_whose_links_go_in_a_circle_is_one_line(tmp_path, out, capsys):
    out.symlink_to("out")
    for more in ([], ["--force"]):
        assert typed("check", "--out", out, *more) == 2
        error = capsys.readouterr().err.splitlines()[-1]
        assert (
            error == f"tireid check: error: {tmp_path / 'out'}: too many levels of symbolic links"
        )
    words = ["fleet", "learn", "log.csv", "--vehicle", "car.toml", "--out", out]
    assert typed(*words) == 2
    assert [one.name for one in tmp_path.iterdir()] == ["out"]


def test_the_backend_of_a_notebook_is_not_asked_for_by_a_command(out):
    """`!tireid` in a notebook inherits one that another environment has installed."""
    backend = "module://matplotlib_inline_of_another_environment"
    answer = subprocess.run(
        [sys.executable, "-m", "tireid.cli", "check", "--out", str(out)],
        env={**os.environ, "MPLBACKEND": backend},
        capture_output=True,
        text=True,
    )
    assert answer.returncode == 0, answer.stderr
