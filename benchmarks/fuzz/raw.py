"""Mutations that know no format: bytes and lines of a file, and what kind of file it is."""

import os
import random
from pathlib import Path

BYTES = (
    b"\x00",
    b"\xff",
    b"\xfe\xff",
    b"\xef\xbb\xbf",
    b"\x1f\x8b",
    b"\r",
    b"\n",
    b'"',
    b",",
    b"\x1b[31m",
)
ZEROS, FULL = "/dev/zero", "/dev/full"


def bytes_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a file with a few bytes changed, cut out, doubled or put in.

    Parameters
    ----------
    rng : source of chance.
    data : of the file.
    """
    at, size = rng.randrange(len(data) + 1), int(2 ** rng.uniform(0.0, 10.0))
    match rng.randrange(7):
        case 0:  # a bit
            at = min(at, max(len(data) - 1, 0))
            return (
                data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
                if data
                else b"\0"
            )
        case 1:  # cut off
            return data[:at]
        case 2:
            return data[:at] + data[at + size :]
        case 3:
            return data[:at] + data[at : at + size] * 2 + data[at + size :]
        case 4:
            return data[:at] + rng.randbytes(size) + data[at + size :]
        case 5:
            return data[:at] + rng.choice(BYTES) + data[at:]
        case _:
            return rng.choice((b"", b"\0" * 4096, rng.randbytes(512), data[::-1], data * 2))


def lines_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a text file with lines left out, doubled, joined, swapped or of other ends.

    Parameters
    ----------
    rng : source of chance.
    data : of the file.
    """
    lines = data.split(b"\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(7):
        case 0:
            del lines[at]
        case 1:
            lines.insert(other, lines[at])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines[at : at + 2] = [b"".join(lines[at : at + 2])]
        case 4:
            return b"\r\n".join(lines)
        case 5:
            lines[at] = b"#" + lines[at]
        case _:
            lines[at] = lines[at] * rng.choice((2, 1000))
    return b"\n".join(lines)


def other_kind(rng: random.Random, path: Path) -> str:
    """Put something in the place of a file that is no such file; return what.

    Parameters
    ----------
    rng : source of chance.
    path : of the file, which is there.
    """
    kind = rng.choice(("missing", "empty", "folder", "itself", "dangling", "pipe", "zeros", "full"))
    if path.is_dir() and not path.is_symlink():
        return "folder"  # it has become one already
    path.unlink(missing_ok=True)
    match kind:
        case "empty":
            path.write_bytes(b"")
        case "folder":
            path.mkdir()
        case "itself":
            path.symlink_to(path.name)
        case "dangling":
            path.symlink_to("nowhere")
        case "pipe":
            os.mkfifo(path)
        case "zeros":
            path.symlink_to(ZEROS)
        case "full":
            path.symlink_to(FULL)
    return kind
