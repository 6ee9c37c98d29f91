"""A film of a drive: the car, its plan, the forces of its tires, as WebP, GIF or MP4."""

from tireid.animation.film import FORMATS, SHOWN, require_ffmpeg, write_film

__all__ = ["FORMATS", "SHOWN", "require_ffmpeg", "write_film"]
