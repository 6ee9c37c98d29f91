"""A claim on a folder that only one process holds."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from codegen.errors import TireidError

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

_UNLOCKABLE = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL}


class ClaimedError(TireidError, OSError):
    """Another process holds the claim."""

    def refusal(self, doing: str) -> str:
        return (
            f"another run of tireid {doing}: wait for it, or choose another folder "
            f"(where there is none, delete {self})"
        )


@contextmanager
def claim(path: Path) -> Iterator[None]:
    """Hold a file that only one process can hold; it is gone afterwards.

    The system lets go of it when the process ends, however it ends. Where it locks no files (not on
    Unix, or on a disk that cannot), the file itself is the claim, and outlives a process that is
    killed.
    """
    held = _locked(path)
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(held)


def _locked(path: Path) -> int:
    """Return the open file of a claim: one that we made, or one that nobody locks any more."""
    flags = os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0)
    while True:
        try:
            held, ours = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o600), True
        except FileExistsError:
            try:
                held, ours = os.open(path, flags), False
            except FileNotFoundError:  # removed since
                continue
        try:
            _lock(held, ours=ours)
            if os.path.samestat(os.fstat(held), path.stat()):
                return held
        except FileNotFoundError:  # its holder removed it before it let go
            pass
        except BlockingIOError as error:
            os.close(held)
            raise ClaimedError(str(path)) from error
        os.close(held)


def _lock(held: int, *, ours: bool) -> None:
    """Lock a file; where that cannot be, who made the file has it, and others are refused."""
    try:
        if fcntl is None:
            raise OSError(errno.ENOLCK, "no locks")
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError as error:
        if error.errno not in _UNLOCKABLE:
            raise
        if not ours:
            raise BlockingIOError(errno.EAGAIN, "held") from error
