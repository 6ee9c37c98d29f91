"""A film of a drive: the car, its plan, the forces of its tires, as GIF or MP4."""

from tireid.animation.film import FORMATS, write_film
from tireid.animation.frames import require_ffmpeg

__all__ = ["FORMATS", "require_ffmpeg", "write_film"]
