"""Pictures of README and docs: `python -m benchmarks.readme_picture`."""

import re
import shutil
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

import tireid as ti
from tireid.cli import main as tireid
from tireid.commands.demo import LANE_CHANGE, drive_story
from tireid.commands.demo_story import run_story
from tireid.live.live import Live
from tireid.live.outputs import Outputs

FILM, CURVES, LAP, LIVE = "drive.webp", "tires.webp", "lap.webp", "live.webp"
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


def draw_live(target: Path = DOCS / LIVE, width: int = 1200, height: int = 1010) -> None:
    """Save the page of a live run over the sample log as a browser shows it, in pixels."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        print(f"{target.name} stays as it was: a browser is needed, as by apt-get install chromium")
        return
    log, live = ti.sample_recording(), Live(ti.sedan())
    assert log.v_y is not None
    rows = zip(log.t, log.v_x, log.r, log.delta_f, log.v_y, strict=True)
    fed = (live.feed(t, v_x, r, delta_f, v_y=v_y) for t, v_x, r, delta_f, v_y in rows)
    states = [state for state in fed if state is not None]
    with Outputs(("127.0.0.1", 0)) as outputs, TemporaryDirectory() as folder:
        picture, page = Path(folder) / "page.png", re.search(r"http:\S+/", outputs.words)
        assert page is not None
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        words += [f"--user-data-dir={folder}", f"--window-size={width},{height}"]
        words += [f"--screenshot={picture}", "--virtual-time-budget=60000"]  # ms, 5 s of ours
        with subprocess.Popen([browser, *words, page[0]], stderr=subprocess.DEVNULL) as run:
            while run.poll() is None:  # the drive, again and again until the browser has it
                for state in [*states, *[states[-1]] * 300]:
                    outputs.send(state)
                    time.sleep(0.004)
        with Image.open(picture) as shown:
            shown.convert("RGB").save(target, quality=80, method=6)


def main() -> None:
    """Draw the tires of the sample log, a lap on them, a live run, and the demo's drive."""
    draw_log()
    draw_live()
    story = run_story()
    with TemporaryDirectory() as folder:
        drive_story(story, Path(folder))
        (DOCS / FILM).write_bytes((Path(folder) / LANE_CHANGE / FILM).read_bytes())
    print(f"wrote {DOCS}/{CURVES}, {LAP}, {LIVE} and {FILM}")


if __name__ == "__main__":
    main()
