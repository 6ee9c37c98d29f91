"""The pictures of README and docs/driving.md: `python -m benchmarks.readme_picture`."""

from pathlib import Path
from tempfile import TemporaryDirectory

from tireid.commands.demo_parts import LANE_CHANGE, drive_story
from tireid.commands.demo_story import run_story
from tireid.figures.forces import side_by_side_figure
from tireid.figures.style import figure_png

FILM = "drive.webp"
DOCS = Path(__file__).resolve().parents[1] / "docs"


def main() -> None:
    """Draw the demo's models on a step steer that they have not seen, and the film of its drive."""
    story = run_story()
    figure = side_by_side_figure(story.side_by_side("step_steer"))
    (DOCS / "forces.png").write_bytes(figure_png(figure, resolution=130))
    with TemporaryDirectory() as folder:
        drive_story(story, Path(folder))
        (DOCS / FILM).write_bytes((Path(folder) / LANE_CHANGE / FILM).read_bytes())
    print(f"wrote {DOCS}/forces.png and {FILM}")


if __name__ == "__main__":
    main()
