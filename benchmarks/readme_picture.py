"""Pictures of README, docs/index.md and docs/driving.md: `python -m benchmarks.readme_picture`."""

from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from tireid.cli import main as tireid
from tireid.commands.demo import LANE_CHANGE, drive_story
from tireid.commands.demo_story import run_story

FILM, CURVES = "drive.webp", "tires.webp"
DOCS = Path(__file__).resolve().parents[1] / "docs"


def draw_curves(target: Path) -> None:
    """Save the first figure of the report that the README's commands write.

    target : of the picture.
    """
    with TemporaryDirectory() as folder:
        log, car, out = (str(Path(folder) / name) for name in ("log.csv", "car.toml", "out"))
        tireid(["sample", log, "--car", car])
        tireid(["identify", log, "--vehicle", car, "--out", out])
        with Image.open(Path(out) / "slip.png") as figure:
            figure.convert("RGB").save(target, quality=80, method=6)


def main() -> None:
    """Draw the tires of the sample log, and the film of the demo's drive."""
    draw_curves(DOCS / CURVES)
    story = run_story()
    with TemporaryDirectory() as folder:
        drive_story(story, Path(folder))
        (DOCS / FILM).write_bytes((Path(folder) / LANE_CHANGE / FILM).read_bytes())
    print(f"wrote {DOCS}/{CURVES} and {FILM}")


if __name__ == "__main__":
    main()
