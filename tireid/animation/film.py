"""A drive as a film."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath

from mpc.loop import Drive
from tireid.animation.frames import Pixels, reel, write_gif, write_mp4
from tireid.animation.scene import Scene
from tireid.figures.tire_curve import TireCurve
from tireid.progress import say

FORMATS = ("gif", "mp4")


def write_film(
    file: FilePath,
    drives: Mapping[str, Drive],
    curves: Sequence[TireCurve],
    *,
    drops: Sequence[tuple[float, float]] = (),
    title: str,
) -> None:
    """Write the film of a drive; other drives ride along as ghosts.

    Parameters
    ----------
    file : ends in .gif or .mp4.
    drives : by the name in the legend, along one path; the camera follows the first.
    curves : tire curves behind the forces of the first.
    drops : arc length [m] and friction from there on.
    title : what the film is about.

    Raises
    ------
    ValueError
        For an MP4 where there is no ffmpeg.
    """
    first = next(iter(drives.values()))
    instants, pace = reel(float(first.t[-1] - first.t[0]))
    scene = Scene(drives, curves, drops=drops, pace=pace, title=title)

    def pictures() -> Iterator[Pixels]:
        for number, t in enumerate(instants, start=1):
            yield scene.picture(float(t))
            if number == len(instants) or number % 50 == 0:
                say(f"film: frame {number} of {len(instants)}")

    (write_mp4 if file.suffix == ".mp4" else write_gif)(file, pictures())
