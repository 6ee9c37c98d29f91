"""Pictures of README and docs: `python -m benchmarks.readme_picture`."""

from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from tireid.cli import main as tireid
from tireid.commands.demo import LANE_CHANGE, drive_story
from tireid.commands.demo_story import run_story

FILM, CURVES, LAP = "drive.webp", "tires.webp", "lap.webp"
DOCS = Path(__file__).resolve().parents[1] / "docs"


def draw_log() -> None:
    """Save the tires of the sample log, and a lap on them, as README's commands draw them."""
    with TemporaryDirectory() as folder:
        log, car, out, lap = (f"{folder}/{name}" for name in ("log.csv", "car.toml", "out", "lap"))
        tireid(["sample", log, "--car", car])
        tireid(["identify", log, "--vehicle", car, "--out", out])
        tireid(["lap", str(Path(out) / "weights.json"), "--path", "course", "--out", lap])
        for source, target in ((Path(out) / "slip.png", CURVES), (Path(lap) / "lap.png", LAP)):
            with Image.open(source) as figure:
                figure.convert("RGB").save(DOCS / target, quality=80, method=6)


def main() -> None:
    """Draw the tires of the sample log, a lap on them, and the film of the demo's drive."""
    draw_log()
    story = run_story()
    with TemporaryDirectory() as folder:
        drive_story(story, Path(folder))
        (DOCS / FILM).write_bytes((Path(folder) / LANE_CHANGE / FILM).read_bytes())
    print(f"wrote {DOCS}/{CURVES}, {LAP} and {FILM}")


if __name__ == "__main__":
    main()
