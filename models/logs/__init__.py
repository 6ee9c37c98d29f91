"""Logs as loggers write them: formats, channels, units, clocks, and what each channel may be.

The package needs NumPy alone and knows nothing of cars' tires; libraries of foreign formats are
imported when such a file comes. Its face:

    log = open_log("drive.mf4")              a `LogFile`, of which only the beginning was read
    log.listed()                             its channels: names, units, samples, rates
    propose(log).guesses["v_x"].channel      which channel is which signal, and how sure that is
    log.read(["Speed", "YawRate"])           samples with their times, as in the file

What cannot be read is refused by a `RecordingError` of one line: file, place, rule, remedy.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from models.logs.door import open_log
    from models.logs.log import Channel, Listed, LogFile, RecordingError
    from models.logs.names import Proposal, propose

__all__ = ["Channel", "Listed", "LogFile", "Proposal", "RecordingError", "open_log", "propose"]
_HOMES = {"open_log": "door", "propose": "names", "Proposal": "names"}  # all others: log


def __getattr__(name: str) -> Any:
    """Return a name of the face, fetched at its first use."""
    if name not in __all__:
        raise AttributeError(f"module 'models.logs' has no attribute {name!r}")
    home = importlib.import_module(f"models.logs.{_HOMES.get(name, 'log')}")
    globals()[name] = value = getattr(home, name)
    return value
