"""The generated headers of one export, so that the C compiles where it lies: sedan, default method.

    python -m tests.c_reference.write        # or: make reference

Nobody exports these files. Vectors are the first few; versions and hashes are none.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from identifier.export.fmu import token_header
from identifier.export.package import build_package, vectors_header
from identifier.methods import LIVE, make_method
from models.vehicle import sedan
from mpc.export.package import vectors_header as mpc_vectors_header
from mpc.export.pair import build_pair

FOLDER = Path(__file__).parent
FEW = 4  # vectors


def reference() -> Mapping[str, str]:
    """Return what the generators write today, by the name of the file."""
    car = sedan()
    package = build_package(make_method(LIVE, car), car)
    pair = build_pair(package)
    texts = {**package.files, **pair.tracker.files, **pair.files}
    found = pair.tracker.vectors
    found = found._replace(
        measured=found.measured[:FEW], expected=found.expected[:FEW], road=found.road[: FEW + 1]
    )
    headers = {
        **{Path(path).name: text for path, text in texts.items() if _is_wanted(path)},
        "token.h": token_header("{00000000}", 2),
        "tireid_vectors.h": vectors_header(package.specialized, FEW),
        "tireid_mpc_vectors.h": mpc_vectors_header(pair.tracker.name, found),
    }
    return {name: _undated(text) for name, text in headers.items()}


def _is_wanted(path: str) -> bool:
    return path.endswith(("_config.h", "_tables.h"))


def _undated(text: str) -> str:
    """Return a header without version and hash, which every other change moves."""
    # First, as a hash may begin with a digit and look like a version.
    text = re.sub(r'"tireid\w* \w{12}, tireid [^"]*"', '"reference"', text)
    return re.sub(r"\btireid (\d[\w.+]*|unknown)( from \w+)?", "tireid", text)


if __name__ == "__main__":
    for name, text in reference().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
