"""The output folder: whole or as before, and nothing of the user's is ever lost."""

import errno
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from tests.tireid.conftest import json_of
from tireid import exchange as exchange_module
from tireid import output as output_module
from tireid.exchange import ClaimedError, claim, exchange
from tireid.output import MARKER, OutputError, foreign, output_folder


@pytest.fixture(params=["at once", "in two steps"])
def swaps(request, monkeypatch):
    """Both ways to replace a folder, the second where the system cannot exchange names."""
    if request.param == "in two steps":
        monkeypatch.setattr(output_module, "exchange", lambda *_: False)
    return request.param


def write(target, text="new", *, force=False):
    with output_folder(target, force=force) as folder:
        (folder / "result.txt").write_text(text)


def content(folder):
    """Every file below a folder and its text, markers left out."""
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != MARKER
    }


def refused(target, *, force=True):
    """Ask for a folder and return why it was refused; it must be so before any work is done."""
    with pytest.raises(OutputError) as caught, output_folder(target, force=force):
        pytest.fail("the work began")
    return str(caught.value)


def test_a_folder_appears_with_all_that_was_written(tmp_path):
    write(tmp_path / "deep" / "out")
    assert content(tmp_path / "deep") == {"out/result.txt": "new"}
    assert [entry.name for entry in (tmp_path / "deep").iterdir()] == ["out"]
    marker = json_of(tmp_path / "deep" / "out" / MARKER)
    assert marker["files"]["result.txt"][0] == len("new")


def test_an_empty_folder_is_filled_and_our_own_replaced_when_asked(tmp_path, out, swaps):
    out.mkdir()
    write(out, "first")
    assert "--force" in refused(out, force=False)
    assert content(out)["result.txt"] == "first"
    with output_folder(out, force=True) as folder:
        (folder / "other.txt").write_text("second")
    assert content(tmp_path) == {"out/other.txt": "second"}
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def test_a_foreign_folder_survives_force(tmp_path):
    data = tmp_path / "data"
    (data / "sub").mkdir(parents=True)
    (data / "sub" / "log.csv").write_text("precious")
    for force in (True, False):
        assert "holds sub, which no run of tireid wrote" in refused(data, force=force)
    assert content(tmp_path) == {"data/sub/log.csv": "precious"}


def test_what_a_user_added_to_our_folder_survives_force(tmp_path, out):
    write(out)
    (out / "notes.txt").write_text("precious")
    assert "holds notes.txt" in refused(out)
    assert content(tmp_path)["out/notes.txt"] == "precious"


@pytest.mark.parametrize("where", [".", "..", "/", "inner/.."])
def test_the_working_folder_and_those_around_it_are_refused(tmp_path, monkeypatch, where):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert "working folder" in refused(Path(where))
    assert here.is_dir()


def test_the_home_folder_is_refused(tmp_path, monkeypatch):
    home = tmp_path / "users" / "me"
    home.mkdir(parents=True)
    monkeypatch.setenv("HOME", str(home))
    for place in (home, home.parent):
        assert "home folder" in refused(place)
    write(home / "out")
    assert content(home)["out/result.txt"] == "new"


def test_a_file_in_the_way_is_refused(tmp_path, out):
    out.write_text("precious")
    assert "is a file" in refused(out)
    assert content(tmp_path) == {"out": "precious"}


def test_a_link_leads_to_the_folder_and_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link"
    link.symlink_to("real")
    write(link)
    write(link, "again", force=True)
    assert link.is_symlink()
    assert content(tmp_path / "real")["result.txt"] == "again"
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "log.csv").write_text("precious")
    link.unlink()
    link.symlink_to("foreign")
    assert "holds log.csv" in refused(link)


def test_a_failing_body_leaves_the_old_folder_and_no_scratch(tmp_path, out):
    write(out, "old")
    before = content(tmp_path)
    for error in (RuntimeError, KeyboardInterrupt):
        with pytest.raises(error), output_folder(out, force=True) as folder:
            (folder / "half.txt").write_text("half")
            raise error
    assert content(tmp_path) == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def fail_to_rename(monkeypatch, *, onto, names=("new",)):
    """Let folders of some names fail to take a place; return the list of such failures."""
    rename = Path.rename
    failures = []

    def failing(self, target):
        if Path(target) == onto and self.name in names:
            failures.append(self)
            raise OSError("disk trouble")
        return rename(self, target)

    monkeypatch.setattr(output_module, "exchange", lambda *_: False)
    monkeypatch.setattr(Path, "rename", failing)
    return failures


def test_a_rename_that_fails_restores_the_old_folder(tmp_path, out, monkeypatch):
    write(out, "old")
    before = content(tmp_path)
    failures = fail_to_rename(monkeypatch, onto=out)
    with pytest.raises(OSError, match="disk trouble"):
        write(out, "new", force=True)
    assert len(failures) == 2  # where the place is free, and in place of the old one
    assert content(tmp_path) == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def test_an_old_folder_that_cannot_be_put_back_is_kept_aside(tmp_path, out, monkeypatch, capsys):
    write(out, "old")
    fail_to_rename(monkeypatch, onto=out, names=("new", "old"))
    with pytest.raises(OSError, match="disk trouble"):
        write(out, "new", force=True)
    (kept,) = tmp_path.iterdir()
    assert content(kept)["old/result.txt"] == "old"
    monkeypatch.undo()
    write(out, "later")
    assert f"left {kept}" in capsys.readouterr().err
    assert content(kept)["old/result.txt"] == "old"


def write_deep(target):
    with output_folder(target, force=True) as folder:
        (folder / "part" / "deep").mkdir(parents=True)
        (folder / "part" / "deep" / "result.txt").write_text("result")
        (folder / "part" / "empty").mkdir()


CHANGES = {
    "a file": lambda out: (out / "part" / "deep" / "notes.txt").write_text("precious"),
    "a file in an empty folder": lambda out: (out / "part" / "empty" / "x.txt").write_text("mine"),
    "a folder": lambda out: (out / "part" / "mine").mkdir(),
    "a link": lambda out: (out / "part" / "link").symlink_to(out.parent),
    "a pipe": lambda out: os.mkfifo(out / "part" / "pipe"),
    "a longer file": lambda out: (out / "part" / "deep" / "result.txt").write_text("result and"),
    "other bytes": lambda out: (out / "part" / "deep" / "result.txt").write_text("RESULT"),
    "a spoilt marker": lambda out: (out / MARKER).write_text("[" * 100_000),
}


@pytest.mark.parametrize("spoil", CHANGES.values(), ids=CHANGES)
def test_what_a_user_does_at_the_last_moment_survives_force(
    tmp_path, out, monkeypatch, swaps, spoil
):
    write_deep(out)

    calls = []

    def late(one, other):
        calls.append(one)
        if len(calls) == 1:
            spoil(out)
        return swaps == "at once" and exchange(one, other)

    monkeypatch.setattr(output_module, "exchange", late)
    with pytest.raises(OutputError, match=r"came to hold .*; what this run computed is in .*out-2"):
        write(out, force=True)
    assert foreign(out) is not None
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out", "out-2"]
    assert content(tmp_path / "out-2") == {"result.txt": "new"}


@pytest.mark.parametrize("theirs", ["folder", "results of tireid", "file"])
def test_what_appears_while_a_run_works_is_left_alone(tmp_path, out, theirs):
    with pytest.raises(OutputError, match=r"what this run computed is in .*out-2$"):  # noqa: SIM117
        with output_folder(out, force=False) as folder:
            (folder / "result.txt").write_text("hours of work")
            if theirs == "folder":
                out.mkdir()
                (out / "precious.txt").write_text("precious")
            elif theirs == "file":
                out.write_text("precious")
            else:
                write(tmp_path / "other", "precious")
                (tmp_path / "other").rename(out)
    assert "precious" in content(tmp_path).values()
    assert content(tmp_path / "out-2") == {"result.txt": "hours of work"}


def test_an_interruption_at_any_moment_of_the_exchange_leaves_one_folder_whole(
    tmp_path, out, monkeypatch, swaps
):
    write(out, "old")
    rename = Path.rename
    for moment in range(1, 9):
        calls = []

        def interrupted(self, target, calls=calls, moment=moment):
            calls.append(target)
            if len(calls) == moment:
                raise KeyboardInterrupt
            return rename(self, target)

        monkeypatch.setattr(Path, "rename", interrupted)
        try:
            write(out, "new", force=True)
        except KeyboardInterrupt:
            assert content(tmp_path) == {"out/result.txt": "old"}
        else:
            break
    assert moment == (3 if swaps == "at once" else 4)  # each rename was interrupted once
    assert content(tmp_path) == {"out/result.txt": "new"}


def test_a_second_run_is_refused_at_once_and_says_why(tmp_path, out):
    with output_folder(out, force=True):
        assert "another run of tireid is writing" in refused(out)
        with output_folder(tmp_path / "beside", force=True):
            pass
    write(out, force=True)


def test_a_claim_without_locks_is_the_file_itself(tmp_path, monkeypatch):
    def unable(*_):
        raise OSError(errno.ENOLCK, "no locks here")

    monkeypatch.setattr(exchange_module.fcntl, "flock", unable)
    with claim(tmp_path / "claim"), pytest.raises(ClaimedError), claim(tmp_path / "claim"):
        pytest.fail("two hold it")
    assert list(tmp_path.iterdir()) == []


def ran(program, folder):
    words = [sys.executable, "-c", textwrap.dedent(program)]
    answer = subprocess.run(
        words,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert answer.returncode == 0, answer.stderr
    return answer.stdout.split()


FORKED = """
    import os, random, signal, sys, time
    from pathlib import Path
    from tireid.output import OutputError, output_folder

    out = Path("out")

    def forked(work):
        child = os.fork()
        if child:
            return child
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            work()
            os._exit(0)
        except OutputError:
            os._exit(2)
        finally:
            os._exit(9)

    def write(text, *, force, files=30):
        with output_folder(out, force=force) as folder:
            (folder / "deep").mkdir()
            for i in range(files):
                (folder / "deep" / f"{i}.txt").write_text(text)
"""


@pytest.mark.sweep("True")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.parametrize("at_once", [True, False])
def test_a_run_that_is_killed_leaves_the_old_folder_or_the_new_one(tmp_path, at_once):
    program = f"""
    from tireid import output
    from tireid.output import foreign
    if not {at_once}:
        output.exchange = lambda *_: False
    random.seed(1)
    write("start", force=False)
    start = time.perf_counter()
    write("begin", force=True)
    lasts = time.perf_counter() - start
    seen, lost = {{"begin"}}, 0
    for i in range(60):
        child = forked(lambda: write(f"run {{i}}", force=True))
        time.sleep(random.uniform(0.0, (0.5 + i / 15) * lasts))  # on a busy machine, later
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        folder = out
        if not out.exists():  # between the two renames
            (folder,) = [p / "old" for p in Path().glob(".out-*.part") if (p / "old").exists()]
            lost += 1
        assert foreign(folder) is None
        texts = {{path.read_text() for path in folder.rglob("*.txt")}}
        assert len(texts) == 1 and len(list(folder.rglob("*.txt"))) == 30
        seen |= texts
        if folder is not out:
            folder.rename(out)
        assert (out / "deep").is_dir()
        for path in Path().glob(".out-*.part"):
            assert path.is_dir()
            import shutil
            shutil.rmtree(path)
    assert len(seen) > 3, "no kill came after the rename"
    print("lost" if lost and {at_once} else "kept")
    """
    assert ran(textwrap.dedent(FORKED) + textwrap.dedent(program), tmp_path) == ["kept"]


def test_what_cannot_be_written_is_named_by_every_writer(tmp_path):
    pytest.importorskip("resource")
    program = """
    import resource
    from pathlib import Path
    import numpy as np
    from matplotlib.figure import Figure
    from codegen.writing import write_file
    from models.files import write_atomically
    from tireid.cli import one_line
    from tireid.figures.style import save_figures
    from tireid.output import output_folder, write_csv, write_json

    columns = {"t_s": np.random.default_rng(0).random(9999)}
    here, text = Path.cwd(), "x" * 9999

    def folder(path):
        with output_folder(path, force=False) as new:
            write_json(new / "deep.json", [text])

    writers = {
        "data.json": lambda path: write_json(path, [text]),
        "rows.csv": lambda path: write_csv(path, columns),
        "model.json": lambda path: write_atomically(path, text),
        "figure.png": lambda path: save_figures(path.parent, {path.stem: Figure()}),
        "page.html": lambda path: write_file(path, text),
        "results": folder,
    }
    save_figures(here, {"warm": Figure()})
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
    for name, write in writers.items():
        try:
            write(here / name)
        except OSError as error:
            print(one_line(error).replace(f"{here}/", ""))
    """
    told = " ".join(ran(textwrap.dedent(program), tmp_path))
    names = ("data.json", "rows.csv", "model.json", "figure.png", "page.html")
    wanted = [f"{name}: file too large" for name in (*names, "results/deep.json")]
    assert told == " ".join(wanted)
