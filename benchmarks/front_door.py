"""How long one waits at the door: `import tireid` and `tireid --help`, each in a fresh Python.

Wall time of whole processes, the median of many; a bare Python stands beside them.

    python -m benchmarks.front_door [RUNS] [--record]
"""

import statistics
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence

from benchmarks.targets import Targets, keeps

RUNS = 15
LONGEST = 150.0  # ms
DOORS: Mapping[str, Sequence[str]] = {
    "import": ["-c", "import tireid"],
    "help": ["-m", "tireid", "--help"],
}


def milliseconds(words: Sequence[str], runs: int) -> float:
    """Return the median time of a Python that does something and ends [ms].

    Parameters
    ----------
    words : after `python`.
    runs : how many.
    """
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL)
        times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times)


def main() -> int:
    """Print the times; 1 where one is too long."""
    counts = [word for word in sys.argv[1:] if word.isdigit()]
    runs = int(counts[0]) if counts else RUNS
    targets = Targets("front_door")
    targets.record("python", milliseconds(["-c", "pass"], runs), "ms")
    for name, words in DOORS.items():
        targets.at_most(name, milliseconds(words, runs), LONGEST, "ms", name)
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
