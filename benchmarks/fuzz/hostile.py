"""What nobody would write who means well: numbers, texts and tokens, for every format alike."""

import random

LARGEST = 1e300  # that can be multiplied
LONGEST = 5000  # digits of an int, letters of a name
DEEPEST = 20_000  # brackets

NUMBERS = (
    0.0, -0.0, -1.0, 1e-320, 1e-9, 1e-3, 0.5, 1.0, 2.0, 1e3, 1e6, 1e9, 1e30, 1e154, 1e308, -1e308,
    float("inf"), float("-inf"), float("nan"),
)  # fmt: skip
INTEGERS = (0, 1, -1, 2, 3, 255, 10_000, 2**31, -(2**31), 2**53 + 1, 2**63, 10**18, 10**400)
TEXTS = (
    "", " ", "-", "--", ".", "..", "/", "../../up", "~", "nan", "inf", "-inf", "1e308", "-1", "0",
    "1e-320", "1e999", "0x10", "1_0", "١٢", "１２", "true", "null", "[]", "{}", "%s%n%d", "@title@",
    "me@home@x", "*/ int main(); /*", '"); execute_process(COMMAND touch owned) #', "a\nb", "a\rb",
    "a\tb", "\x1b]0;owned\x07", "\x1b[2J", "\x7f", "\x85", "\u202eesrever", "\ufeff", "\u2028",
    "name with spaces", "naïve—🚗", "é" * 300, "x" * LONGEST, "'; drop", "$(id)", "\udcff", "CON",
    "__class__", "../car.toml", "/dev/null", "/dev/zero", "/proc/self/mem",
)  # fmt: skip


def number(rng: random.Random, value: float) -> float:
    """Return a number that stands in for another: far off, or near and still wrong.

    Parameters
    ----------
    rng : source of chance.
    value : what stood there.
    """
    near = (
        -1.0,
        0.0,
        1e-3,
        1e3,
        57.29577951308232,
        0.017453292519943295,
        3.6,
        1e-12,
        1e12,
        0.5,
        2.0,
    )
    if rng.random() < 0.4 or abs(value) > LARGEST:
        return rng.choice(NUMBERS)
    return value * rng.choice(near)


def text(rng: random.Random) -> str:
    """Return a text that a program may stumble over.

    Parameters
    ----------
    rng : source of chance.
    """
    return rng.choice(TEXTS)
