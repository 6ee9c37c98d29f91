"""Files that appear whole or not at all.

Rules that numbers must keep wherever they come from.
"""

import hashlib
import json
import math
import tempfile
from os import PathLike
from pathlib import Path
from typing import Any


def write_atomically(path: str | PathLike[str], content: str | bytes) -> None:
    """Write a file; whoever reads it meanwhile, or after a failure, sees the old one whole.

    Parameters
    ----------
    path : the file; where it is a link, what it points to.
    content : text, written in UTF-8 with line ends as they are, or bytes.

    Raises
    ------
    OSError
        Where the file cannot be written; nothing is left behind.
    """
    target = Path(path).resolve()
    data = content.encode("utf-8") if isinstance(content, str) else content
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as scratch:
        part = Path(scratch) / target.name  # in the same folder, thus on the same disk
        part.write_bytes(data)
        part.replace(target)


def digest(content: Any) -> str:
    """Return twelve characters that stand for a content.

    Parameters
    ----------
    content : ready for JSON.
    """
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


LARGEST_FORCE = 1e7  # of an axle [N]: ten times that of the heaviest dump truck


def require_positive(refusal: type[ValueError], /, **values: float) -> None:
    """Refuse every value that is not a finite number above zero.

    Parameters
    ----------
    refusal : class of the error to raise.
    **values : what to check, by name.

    Raises
    ------
    ValueError
        Of that class, with the first name that breaks the rule and its value; NaN breaks it too.
    """
    for name, value in values.items():
        if not (value > 0.0 and math.isfinite(value)):
            raise refusal(f"{name} must be positive and finite, it is {value}")


def require_within(refusal: type[ValueError], low: float, high: float, /, **values: float) -> None:
    """Refuse every value outside the closed interval from `low` to `high`.

    Parameters
    ----------
    refusal : class of the error to raise.
    low, high : ends of the interval, in the unit of the values.
    **values : what to check, by name.

    Raises
    ------
    ValueError
        Of that class, with the first name that breaks the rule and its value; NaN breaks it too.
    """
    for name, value in values.items():
        if not low <= value <= high:
            raise refusal(f"{name} must lie between {low:g} and {high:g}, it is {value:.10g}")
