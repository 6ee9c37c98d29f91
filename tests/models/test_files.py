"""One way to write a file: whole, or as it was before."""

import os
import stat
from dataclasses import replace
from io import FileIO
from pathlib import Path

import numpy as np
import pytest

from models.files import write_atomically
from models.recordings import Recording, write_recording
from models.vehicle import sedan


def test_text_and_bytes_arrive_as_they_are(tmp_path):
    write_atomically(tmp_path / "text", "ä\nb\r\n")
    write_atomically(str(tmp_path / "bytes"), b"\x00\xff")
    write_atomically(tmp_path / "parts", iter([b"a", b"", b"\x00"]))
    assert (tmp_path / "text").read_bytes() == "ä\nb\r\n".encode()
    assert (tmp_path / "bytes").read_bytes() == b"\x00\xff"
    assert (tmp_path / "parts").read_bytes() == b"a\x00"


def test_a_file_has_the_permissions_of_any_new_file(tmp_path):
    (tmp_path / "plain").write_text("a")
    write_atomically(tmp_path / "ours", "a")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "link").symlink_to("real")
    write_atomically(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"


def test_what_is_no_file_is_never_replaced(tmp_path):
    """A file in the place of a device would end it for every program, for who may do that."""
    pipe, folder = tmp_path / "pipe", tmp_path / "folder"
    os.mkfifo(pipe)
    folder.mkdir()
    (tmp_path / "link").symlink_to("pipe")
    for path in (pipe, tmp_path / "link"):
        with pytest.raises(OSError, match="device, pipe or socket") as caught:
            write_atomically(path, "new")
        assert caught.value.filename == str(pipe)
        assert stat.S_ISFIFO(pipe.stat().st_mode)
    with pytest.raises(IsADirectoryError) as caught:
        write_atomically(folder, "new")
    assert caught.value.filename == str(folder)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["folder", "link", "pipe"]


def save_recording(path, version):
    signals = dict.fromkeys(("v_x", "v_y", "r", "delta_f", "delta_r"), np.full(10, float(version)))
    write_recording(Recording(name="a", t=0.01 * np.arange(10), **signals), path)


def save_vehicle(path, version):
    replace(sedan(), name=f"version {version}").to_toml(path, overwrite=True)


def save_in_place(path, version):
    with path.open("w") as file:
        file.write(f"version {version}")


class FullDisk(FileIO):
    """A file on a disk without room."""

    def write(self, _):
        raise OSError("disk full")


def require_old_or_new(monkeypatch, path, save):
    """Let writing fail, then the last step: the old file must be there whole, and nothing else."""
    save(path, 1)
    first = path.read_bytes()

    def fail(*_):
        raise OSError("disk full")

    opened = Path.open

    def full(path, mode="r", *rest, **more):
        return FullDisk(path, "w") if "w" in mode else opened(path, mode, *rest, **more)

    for step, broken_step in (("open", full), ("replace", fail)):
        with monkeypatch.context() as broken:
            broken.setattr(Path, step, broken_step)
            with pytest.raises(OSError, match="disk full"):
                save(path, 2)
        assert path.read_bytes() == first
        assert list(path.parent.iterdir()) == [path]
    save(path, 2)
    assert path.read_bytes() != first


@pytest.mark.parametrize("save", [save_recording, save_vehicle])
def test_a_failure_keeps_the_old_file(tmp_path, monkeypatch, save):
    require_old_or_new(monkeypatch, tmp_path / "file.csv", save)


def test_writing_in_place_would_be_noticed(tmp_path, monkeypatch):
    with pytest.raises(AssertionError):
        require_old_or_new(monkeypatch, tmp_path / "file.csv", save_in_place)
