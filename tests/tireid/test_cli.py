"""The command line itself: one-line errors, exit codes, help."""

import pytest

from tireid.cli import main, one_line


@pytest.mark.parametrize(
    "words",
    [["fly"], ["identify"], ["identify", "log.csv"], ["paper", "--seeds", "many"]],
)
def test_wrong_words_are_one_line_with_exit_code_2(capsys, words):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert "error:" in said[0]


def test_help_lists_the_commands(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    said = capsys.readouterr().out
    for command in ("demo", "paper", "identify", "check", "drive"):
        assert command in said


def test_an_error_of_the_system_names_the_file():
    with pytest.raises(OSError) as caught:
        open("/nowhere/at/all.toml")  # noqa: PTH123, SIM115 - the message of open is the subject
    assert one_line(caught.value) == "/nowhere/at/all.toml: no such file or directory"


def test_an_interruption_is_said_and_leaves_nothing(monkeypatch, capsys, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("tireid.commands.paper.run_study", interrupted)
    assert main(["paper", "--out", str(tmp_path / "out")]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [OSError(36, "File name too long", "x" * 5000), "y" * 5000])
def test_what_is_said_of_an_error_is_never_longer_than_a_thousand_characters(error):
    assert len(one_line(error)) < 950
