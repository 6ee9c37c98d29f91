"""Two names that change places at once, where the system can; and a claim that only one holds."""

import ctypes
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

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # <fcntl.h> and <linux/fs.h>
_CANNOT = {errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP, errno.ENOTSUP}  # here, or on this disk
_UNLOCKABLE = {errno.ENOLCK, *_CANNOT}


class ClaimedError(TireidError, OSError):
    """Another process holds the claim."""

    def refusal(self, doing: str) -> str:
        return (
            f"another run of tireid {doing}: wait for it, or choose another folder "
            f"(where there is none, delete {self})"
        )


def exchange(one: Path, other: Path) -> bool:
    """Let two folders change places in one step; return whether the system could."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError, TypeError):  # on other than Linux
        return False
    names = os.fsencode(one), os.fsencode(other)
    if rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], ctypes.c_uint(_RENAME_EXCHANGE)) == 0:
        return True
    number = ctypes.get_errno()
    if number in _CANNOT:
        return False
    raise OSError(number, os.strerror(number), str(other))


@contextmanager
def claim(path: Path) -> Iterator[None]:
    """Hold a file that only one process can hold; it is gone afterwards.

    The system lets go of it when the process ends, however it ends. Where it locks no files (not on
    Unix, or on a disk that cannot), the file itself is the claim, and outlives a process that is
    killed.
    """
    descriptor = _locked(path)
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(descriptor)


def _locked(path: Path) -> int:
    """Return the open file of a claim: one that we made, or one that nobody locks any more."""
    flags = os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0)
    while True:
        try:
            descriptor, ours = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o600), True
        except FileExistsError:
            try:
                descriptor, ours = os.open(path, flags), False
            except FileNotFoundError:  # removed since
                continue
        try:
            _lock(descriptor, ours=ours)
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        except FileNotFoundError:  # its holder removed it before it let go
            pass
        except BlockingIOError as error:
            os.close(descriptor)
            raise ClaimedError(str(path)) from error
        os.close(descriptor)


def _lock(descriptor: int, *, ours: bool) -> None:
    """Lock a file; where that cannot be, who made the file has it, and others are refused."""
    try:
        if fcntl is None:
            raise OSError(errno.ENOLCK, "no locks")
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError as error:
        if error.errno not in _UNLOCKABLE:
            raise
        if not ours:
            raise BlockingIOError(errno.EAGAIN, "held") from error
