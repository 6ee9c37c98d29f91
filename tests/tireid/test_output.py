"""The output folder: whole or as before, and nothing of the user's is ever lost."""

from pathlib import Path

import pytest

from tireid.output import MARKER, OutputError, output_folder


def write(target, text="new", *, force=False):
    with output_folder(target, force=force) as folder:
        (folder / "result.txt").write_text(text)


def content(folder):
    """Every file below a folder and its text."""
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def refused(target, *, force=True):
    """Ask for a folder and return why it was refused; it must be so before any work is done."""
    with pytest.raises(OutputError) as caught, output_folder(target, force=force):
        pytest.fail("the work began")
    return str(caught.value)


def test_a_folder_appears_with_all_that_was_written(tmp_path):
    write(tmp_path / "deep" / "out")
    assert content(tmp_path / "deep") == {"out/result.txt": "new", f"out/{MARKER}": "result.txt\n"}


def test_an_empty_folder_is_filled_and_our_own_replaced_when_asked(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    write(out, "first")
    assert "--force" in refused(out, force=False)
    assert content(out)["result.txt"] == "first"
    with output_folder(out, force=True) as folder:
        (folder / "other.txt").write_text("second")
    assert content(tmp_path) == {"out/other.txt": "second", f"out/{MARKER}": "other.txt\n"}


def test_a_foreign_folder_survives_force(tmp_path):
    data = tmp_path / "data"
    (data / "sub").mkdir(parents=True)
    (data / "sub" / "log.csv").write_text("precious")
    for force in (True, False):
        assert "holds sub, which no run of tireid wrote" in refused(data, force=force)
    assert content(tmp_path) == {"data/sub/log.csv": "precious"}


def test_what_a_user_added_to_our_folder_survives_force(tmp_path):
    write(tmp_path / "out")
    (tmp_path / "out" / "notes.txt").write_text("precious")
    assert "holds notes.txt" in refused(tmp_path / "out")
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


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "out").write_text("precious")
    assert "is a file" in refused(tmp_path / "out")
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


def test_a_mount_point_is_refused_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    monkeypatch.setattr(Path, "is_mount", lambda self: self == tmp_path / "out")
    assert "mount point" in refused(tmp_path / "out")


def test_a_failing_body_leaves_the_old_folder_and_no_scratch(tmp_path):
    write(tmp_path / "out", "old")
    before = content(tmp_path)
    for error in (RuntimeError, KeyboardInterrupt):
        with pytest.raises(error), output_folder(tmp_path / "out", force=True) as folder:
            (folder / "half.txt").write_text("half")
            raise error
    assert content(tmp_path) == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def fail_to_rename(monkeypatch, *, onto):
    """Let the new folder fail to take its place; return the list of such failures."""
    rename = Path.rename
    failures = []

    def failing(self, target):
        if Path(target) == onto and self.name == "new":
            failures.append(self)
            raise OSError("disk trouble")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", failing)
    return failures


def test_a_rename_that_fails_restores_the_old_folder(tmp_path, monkeypatch):
    write(tmp_path / "out", "old")
    before = content(tmp_path)
    failures = fail_to_rename(monkeypatch, onto=tmp_path / "out")
    with pytest.raises(OSError, match="disk trouble"):
        write(tmp_path / "out", "new", force=True)
    assert len(failures) == 1
    assert content(tmp_path) == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def test_an_old_folder_that_cannot_be_put_back_is_kept_aside(tmp_path, monkeypatch):
    write(tmp_path / "out", "old")
    rename = Path.rename

    def failing(self, target):
        if Path(target) == tmp_path / "out":
            raise OSError("disk trouble")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(OSError, match="disk trouble"):
        write(tmp_path / "out", "new", force=True)
    (kept,) = tmp_path.iterdir()
    assert content(kept)["old/result.txt"] == "old"
