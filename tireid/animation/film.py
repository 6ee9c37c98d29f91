"""A drive as a film."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from subprocess import CalledProcessError
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

from codegen.writing import naming
from mpc.loop.record import Drive
from tireid.animation.chosen import CHOSEN
from tireid.animation.known import KnownCurves
from tireid.animation.scene import Scene
from tireid.figures.style import LOOK
from tireid.figures.tires import TireCurve
from tireid.progress import say


def require_ffmpeg() -> str:
    found = shutil.which("ffmpeg")
    if found is None:
        raise ValueError("an MP4 needs ffmpeg, and none was found: install it, or ask for a GIF")
    return found


FORMATS = ("webp", "gif", "mp4")
SHOWN = FORMATS[:2]  # by a page, as pictures


def write_film(
    file: FilePath,
    drives: Mapping[str, Drive],
    curves: Sequence[TireCurve],
    *,
    drops: Sequence[tuple[float, float]] = (),
    title: str,
    known: KnownCurves | None = None,
) -> None:
    """Write the film of a drive; other drives ride along as ghosts.

    file : ends in .webp, .gif or .mp4.   drops : arc length [m] and friction from there on.
    known : of the tires while the first drove; None where nothing was learnt.
    """
    first = next(iter(drives.values()))
    duration = float(first.t[-1] - first.t[0])
    instants = np.linspace(0.0, duration, min(CHOSEN.most, max(2, round(CHOSEN.rate * duration))))
    pace = CHOSEN.rate * duration / instants.size  # seconds of the drive a second of the film
    scene = Scene(drives, curves, drops=drops, pace=pace, title=title, known=known)
    writer = _writer(file)
    try:
        with style.context(["default", LOOK]), writer.saving(scene.figure, str(file), CHOSEN.dots):
            for number, t in enumerate(instants, start=1):
                scene.show(float(t))
                writer.grab_frame()
                if number == len(instants) or number % 50 == 0:
                    say(f"film: frame {number} of {len(instants)}")
            for _ in range(CHOSEN.hold):
                writer.grab_frame()
    except CalledProcessError as error:
        said = str(error.stderr or error).strip().splitlines()
        raise ValueError(f"ffmpeg could not write {file.name}: {said[-1]}") from None


class _WebpWriter(PillowWriter):
    """Pillow's writer at a quality that a page can hold, for which matplotlib's has no word."""

    _frames: list[Any]

    def finish(self) -> None:
        first, *others = self._frames
        words: dict[str, Any] = {"quality": CHOSEN.quality, "minimize_size": True, "loop": 0}
        time = round(1000.0 / CHOSEN.rate)
        with naming(self.outfile):
            first.save(self.outfile, save_all=True, append_images=others, duration=time, **words)


def _writer(file: FilePath) -> AbstractMovieWriter:
    if file.suffix == ".webp":
        return _WebpWriter(fps=CHOSEN.rate)  # type: ignore[arg-type]
    if file.suffix == ".gif":
        return PillowWriter(fps=CHOSEN.rate)  # type: ignore[arg-type]
    require_ffmpeg()
    words = ["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    return FFMpegWriter(fps=CHOSEN.rate, extra_args=words)  # type: ignore[arg-type]
