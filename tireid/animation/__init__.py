"""A film of a drive: the car, its plan, the forces of its tires, as GIF or MP4."""

from tireid.animation.film import FORMATS, require_ffmpeg, write_film

__all__ = ["FORMATS", "require_ffmpeg", "write_film"]
