"""The picture on the first screen of the README: `python -m benchmarks.readme_picture`."""

from pathlib import Path

from tireid.demo_story import run_story
from tireid.figures import figure_png, side_by_side_figure

TARGET = Path(__file__).resolve().parents[1] / "docs" / "forces.png"


def main() -> None:
    """Draw both methods, learnt on the demo's slalom, on the step steer that neither has seen."""
    figure = side_by_side_figure(run_story().side_by_side("step_steer"))
    TARGET.write_bytes(figure_png(figure, resolution=130))
    print(f"wrote {TARGET}")


if __name__ == "__main__":
    main()
