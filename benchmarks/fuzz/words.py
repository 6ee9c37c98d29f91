"""Mutations of the words of a command: values, options left out, doubled, moved and added."""

import random

from benchmarks.fuzz.hostile import NUMBERS, text

COUNTS = ("--jobs", "--seeds", "--laps")
FEW = (
    "-1",
    "0",
    "1",
    "2",
    "1.5",
    "x",
    "",
    "nan",
    "2e0",
    "٢",
)  # more of them is more work, as asked
PLACES = ("--out", "init", "sample")  # what follows is written
OUTS = (
    "out", "out/deep/er", "notes.txt", "data", "log.csv", ".", "..", "/", "~", "", " ", "-",
    "a\nb", "\x1b[31mout", "x" * 300, "o/" * 500, "/dev/null", "/dev/full", "/proc/none/out",
    "é—🚗", "link",
)  # fmt: skip
MORE = (
    "--force", "--debug", "--help", "--version", "--no-check", "--paper", "--json", "--fmu",
    "--no-noise", "--freeze nan", "--freeze 1e308 -5", "--replay log.csv", "--replay :::",
    "--columns x", "--columns r=vy vy=r", "--columns t=vx", "--method linear", "--method none",
    "--seed -1", "--weights axle.json", "--design integral.toml", "--speed 1e999%", "--confirm",
    "--area 1e999 3", "--area x", "--steering-ratio 0", "--speed 0.9", "--speed tires",
    "--speed 1e-9g", "--mu nan",
    "--mu-drop 1e308:1", "--mu-drop ::", "--fault v_y:biased:0:inf:1e308", "--fault r:lost:nan:1",
    "--fault all:noisy:0:1:inf", "--delay 1e9", "--bandwidth 1e-300", "--slip 1e-300",
    "--friction 1e300", "--noise-v-y 1e300", "--speed 1e-300", "--phase-margin 89.999",
    "--phase-margin 180", "--name class", "--name 9", "--name -", "--out", "--tires all linear",
    "--tires", "--film gif", "--scheduler tcp://[",
)  # fmt: skip


def words_mutated(rng: random.Random, words: list[str]) -> list[str]:
    """Return the words of a command with one thing changed.

    Parameters
    ----------
    rng : source of chance.
    words : of the command, its name first.
    """
    words = list(words)
    at = rng.randrange(1, len(words)) if len(words) > 1 else 0
    match rng.randrange(9):
        case 0 if at:
            del words[at]
        case 1 if at:
            words.insert(at, words[at])
        case 2:
            words += rng.choice(MORE).split(" ")
        case 3:
            words += rng.choice(MORE).split(" ")
        case 4 if rng.random() < 0.1:
            words[0] = text(rng)
        case _:
            values = [k for k in range(1, len(words)) if not words[k].startswith("--")]
            if values:
                at = rng.choice(values)
                words[at] = _value(rng, words[at - 1], words[at])
    return words


def _value(rng: random.Random, option: str, old: str) -> str:
    if option in PLACES:
        return rng.choice(OUTS)
    if option in COUNTS:
        return rng.choice(FEW)
    new = rng.choice((text(rng), repr(rng.choice(NUMBERS)), old + rng.choice(":,=%")))
    if ":" in old:
        parts = old.split(":")
        parts[rng.randrange(len(parts))] = new
        return ":".join(parts)
    return new
