"""The picture on the first screen of the README: `python -m benchmarks.readme_picture`."""

from pathlib import Path

from tireid.demo_story import FREEZE, run_story
from tireid.figures import figure_png, force_figure

TARGET = Path(__file__).resolve().parents[1] / "docs" / "forces.png"


def main() -> None:
    """Draw the slalom of the demo, learnt online and replayed frozen."""
    story = run_story()
    own = {FREEZE: story.frozen[FREEZE][story.learnt.recording.name]}
    figure = force_figure(story.learnt, own)
    TARGET.write_bytes(figure_png(figure, resolution=110))
    print(f"wrote {TARGET}")


if __name__ == "__main__":
    main()
