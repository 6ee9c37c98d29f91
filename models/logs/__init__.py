"""Logs as loggers write them: formats, channels, units, clocks, and what each channel may be.

The package needs NumPy alone and knows nothing of cars' tires; libraries of foreign formats are
imported when such a file comes. Its face:

    log = open_log("drive.mf4")              a `LogFile`, of which only the beginning was read
    log.listed()                             its channels: names, units, samples, rates
    propose(log).guesses["v_x"].channel      which channel is which signal, and how sure that is
    log.read(["Speed", "YawRate"])           samples with their times, as in the file

What cannot be read is refused by a `RecordingError` of one line: file, place, rule, remedy.
"""

from typing import TYPE_CHECKING

from codegen.face import face

if TYPE_CHECKING:
    from models.logs.door import open_log as open_log
    from models.logs.log import Channel as Channel
    from models.logs.log import Listed as Listed
    from models.logs.log import LogFile as LogFile
    from models.logs.log import RecordingError as RecordingError
    from models.logs.names import Proposal as Proposal
    from models.logs.names import propose as propose

_HOMES = {
    name: f"models.logs.{module}:{name}"
    for module, names in {
        "door": ("open_log",),
        "log": ("Channel", "Listed", "LogFile", "RecordingError"),
        "names": ("Proposal", "propose"),
    }.items()
    for name in names
}
__getattr__, __dir__ = face(__name__, _HOMES)
