"""A drive as a film."""

import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image

from mpc.loop import Drive
from tireid.animation.scene import Scene
from tireid.figures.style import AMBER, BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY
from tireid.figures.tires import TireCurve
from tireid.progress import say

# Which instants of a drive are shown, how fast, and how they become a GIF or an MP4.

Pixels = NDArray[np.uint8]

RATE = 12.5  # frames a second; a GIF counts in hundredths of a second
MOST = 150  # frames: what stays small and quick to draw
PACES = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)
HOLD = 12  # frames for which the last picture stays
INKS = (BLACK, BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, GREY, "#9ADBC6", "#E2E2DA", "#F6F6F2")
TINTS = (1.0, 0.75, 0.5, 0.3, 0.12)  # of every ink on white: what smooth edges are made of


class Reel(NamedTuple):
    """Instants (k,) [s] of the drive and the pace: seconds of the drive a second of the film."""

    t: NDArray[np.float64]
    pace: float


def reel(duration: float) -> Reel:
    """Return what to show of a drive: at the slowest pace that is not too long.

    Parameters
    ----------
    duration : of the drive [s].
    """
    for pace in PACES:
        if duration * RATE / pace <= MOST:
            break
    count = min(MOST, max(2, round(duration * RATE / pace)))
    return Reel(np.linspace(0.0, duration, count), pace)


def write_gif(file: Path, pictures: Iterable[Pixels]) -> None:
    """Write pictures as a GIF that repeats.

    Parameters
    ----------
    file : to write.
    pictures : RGB (height, width, 3), all of one size, at least one.
    """
    palette = Image.new("P", (1, 1))
    palette.putpalette(inks())
    frames = [
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    ]
    time = round(1000.0 / RATE)
    frames[0].save(
        file,
        save_all=True,
        append_images=frames[1:],
        duration=[time] * (len(frames) - 1) + [time * HOLD],
        loop=0,
        optimize=False,
        disposal=1,
    )


def inks() -> list[int]:
    """Return the palette that all frames share, R, G, B one after another: inks and their tints."""
    colors = [(255, 255, 255)]
    for ink in INKS:
        rgb = 255.0 * np.array(to_rgb(ink))
        colors += [tuple(np.round(255.0 + tint * (rgb - 255.0)).astype(int)) for tint in TINTS]
    return [int(part) for color in colors for part in color]


def write_mp4(file: Path, pictures: Iterable[Pixels]) -> None:
    """Write pictures as an MP4, by ffmpeg.

    Parameters
    ----------
    file : to write.
    pictures : RGB (height, width, 3), all of one size, at least one.

    Raises
    ------
    ValueError
        Where there is no ffmpeg, or it fails.
    """
    ffmpeg = require_ffmpeg()
    stream = list(pictures)
    height, width, _ = stream[0].shape
    words = [ffmpeg, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    words += ["-s", f"{width}x{height}", "-r", f"{RATE}", "-i", "-"]
    words += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(file)]
    film = b"".join(picture.tobytes() for picture in [*stream, *[stream[-1]] * HOLD])
    done = subprocess.run(words, input=film, capture_output=True, check=False)
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise ValueError(f"ffmpeg could not write {file.name}: {said[-1] if said else 'no reason'}")


def require_ffmpeg() -> str:
    """Return the path of ffmpeg.

    Raises
    ------
    ValueError
        Where there is none.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise ValueError("an MP4 needs ffmpeg, and none was found: install it, or ask for a GIF")
    return found


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
