"""Text files as loggers write them: one drive in every dialect, told by its columns."""

import datetime
import math
from typing import NamedTuple

import numpy as np

N, DT = 120, 0.01


class Drive(NamedTuple):
    """Columns in the units that the file is in."""

    t: np.ndarray
    speed: np.ndarray  # km/h
    lateral: np.ndarray  # m/s
    yaw: np.ndarray  # deg/s
    steer: np.ndarray  # deg


def drive():
    """A slalom, to three digits, as files hold it."""
    t = np.round(DT * np.arange(N), 3)
    wave = np.sin(2.0 * t)
    return Drive(
        t, *(np.round(one, 3) for one in (60.0 + 2.0 * wave, 0.1 * wave, 11.3 * wave, -2.5 * wave))
    )


def number(value, decimal="."):
    return f"{value:.3f}".replace(".", decimal)


ROWS = [*zip(*drive(), strict=True)]


def table(delimiter=",", decimal=".", end="\n", quoted=False, trailing=False):
    lines = []
    for row in ROWS:
        cells = [number(one, decimal) for one in row]
        cells = [f'"{cell}"' for cell in cells] if quoted else cells
        lines.append(delimiter.join(cells) + (delimiter if trailing else ""))
    return end.join(lines) + end


def plain(delimiter=",", decimal=".", **how):
    header = delimiter.join(
        ["Time [s]", "Speed [km/h]", "vy [m/s]", "Yaw Rate [deg/s]", "Steering [deg]"]
    )
    return header + "\n" + table(delimiter, decimal, **how)


def units_row(delimiter=";", decimal=","):
    lines = [delimiter.join(["Time", "Speed", "vy", "Yaw Rate", "Steering"])]
    lines += [delimiter.join(["s", "km/h", "m/s", "°/s", "°"])]
    return "\n".join(lines) + "\n" + table(delimiter, decimal)


_MOTEC = """\
"Format","MoTeC CSV File",,,"Workbook","Circuit"
"Venue","Nürburgring",,,"Worksheet","Default"
"Vehicle","Car 7",,,"Vehicle Desc",""
"Driver","A. Driver",,,"Engine ID",""
"Device","M1"
"Comment","wet, then dry"
"Log Date","12/05/2023",,,"Origin Time","0.000","s"
"Log Time","10:11:12",,,"Start Time","0.000","s"
"Sample Rate","100.000","Hz",,"End Time","1.190","s"
"Duration","1.190","s",,"Start Distance","0","m"
"Range","entire outing",,,"End Distance","20","m"
"Beacon Markers","61.2 122.7"


"Time","Ground Speed","Lateral Velocity","Gyro Yaw Velocity","Steering Wheel Angle"
"s","km/h","m/s","deg/s","deg"


"""


def motec():
    """MoTeC i2: every cell quoted, a preamble of pairs, names, units, a blank line."""
    return (_MOTEC + table(quoted=True)).replace("\n", "\r\n")


# AiM Race Studio: pairs, names, units, and each a line of its own.
_AIM = """\
"Format","AiM CSV File"
"Session","Track day"
"Vehicle","Kart"
"Racer","B"
"Championship","X"
"Comment",""
"Date","Saturday, May 20, 2023"
"Time","2:31 PM"
"Sample Rate","100"
"Duration","1.190"
"Segment","Session"
"Beacon Markers","59.1","118.2"
"Segment Times","0:59.100","0:59.100"

"Time","GPS Speed","Lat Vel","GPS Gyro","Steering"
"s","km/h","m/s","deg/s","deg"

"""


def carmaker_dat():
    """IPG CarMaker: columns apart by blanks, names and units in comments."""
    lines = ["#INFOFILE1.1 - Do not remove this line!", "## Testrun: Slalom", "#"]
    lines += ["# Time Car.v Car.vy Car.YawRate Steer.WhlAng", "# s km/h m/s deg/s deg"]
    rows = ["  ".join(f"{one:12.3f}" for one in row) for row in ROWS]
    return "\n".join(lines + rows) + "\n"


CARMAKER = "#Time;Car.v [km/h];Car.vy [m/s];Car.YawRate [deg/s];Steer.WhlAng [deg]\n"


def two_d():
    """2D datarecording: a title, names, units in brackets, decimal commas, tabs."""
    lines = ["2D Datarecording WinARace export", "Event:\tTest", ""]
    lines += ["Time\tV_GPS\tVy\tGyro_Z\tSteer", "[s]\t[km/h]\t[m/s]\t[°/s]\t[°]"]
    return "\r\n".join(lines) + "\r\n" + table("\t", ",", end="\r\n")


_VBOX = """\
File created on 20/05/2023 at 14:31:00

[header]
time
velocity kmh
vy m/s
yaw rate deg/s
steering deg

[channel units]
m/s
deg/s
deg

[comments]
VBOX 3i, 100 Hz

[column names]
time velocity Vy YawRate Steering

[data]
"""


def vbox():
    """Racelogic VBOX: sections; time is hhmmss.ss."""
    rows = [
        f"{clock(t).replace(':', '')} {v:+08.3f} {vy:+.3f} {r:+.3f} {d:+.3f}"
        for t, v, vy, r, d in ROWS
    ]
    return (_VBOX + "\n".join([*rows, ""])).replace("\n", "\r\n")


def clock(t, start=14 * 3600 + 31 * 60 + 59.5):
    """Time of day as hh:mm:ss.sss; a minute passes in the middle of the drive."""
    at = round((start + t) * 1000) % 86_400_000
    return f"{at // 3600000:02d}:{at // 60000 % 60:02d}:{at // 1000 % 60:02d}.{at % 1000:03d}"


def stamped(stamp, name="Time"):
    """The table with another clock."""
    lines = [f"{name},Speed [km/h],vy [m/s],Yaw Rate [deg/s],Steering [deg]"]
    for t, *rest in ROWS:
        lines.append(",".join([stamp(t), *map(number, rest)]))
    return "\n".join(lines) + "\n"


def iso(t):
    start = datetime.datetime(2023, 12, 31, 23, 59, 59, 500_000)
    return (start + datetime.timedelta(milliseconds=round(1000 * t))).isoformat(
        timespec="milliseconds"
    )


def rounded(t, tick):
    """A stamp that is cut to a tick."""
    return f"{math.floor(round(t / tick, 6)) * tick:.3f}"


def fortran():
    rows = [",".join(f"{one:.5E}" for one in row) for row in ROWS]
    return "\n".join([plain().split("\n")[0], *rows]).replace("E", "D").replace("TimD", "TimE")


def renamed(header):
    return header + "\n" + plain().split("\n", 1)[1]


def described(form):
    """Names and units in lines of their own above the rows."""
    pairs = [one.rstrip("]").split(" [") for one in plain().split("\n")[0].split(",")]
    lines = [form.format(k, *pair) for k, pair in enumerate(pairs, start=1)]
    return renamed("\n".join(["Logger : one", "Range : 3600,0", *lines, "", "Log : 7"]))


TWICE = "time_s [s],speed_kmh (km/h),vy_mps [m/s] 1),yaw_rate_deg (deg/s) *OBD,Steering_deg [deg]*"
SPEEDS = {"Speed_kmh": "km/h", "Speed:km/h": "km/h", "Speed (km/h)": "km/h", "Speed": ""}

_TEXTS: dict[str, str | bytes] = {
    "commas": plain(),
    "semicolons": plain(";"),
    "semicolons and decimal commas": plain(";", ","),
    "tabs": plain("\t"),
    "tabs and decimal commas": plain("\t", ","),
    "bars": plain("|"),
    "quoted": plain(quoted=True),
    "quoted decimal commas between commas": plain(decimal=",", quoted=True),
    "rows that end in a delimiter": plain(";", trailing=True),
    "CRLF": plain().replace("\n", "\r\n"),
    "CR": plain().replace("\n", "\r"),
    "Latin-1": units_row().encode("latin-1"),
    "UTF-8": units_row(),
    "UTF-8 with mark": units_row().encode("utf-8-sig"),
    "UTF-16": units_row().encode("utf-16"),
    "UTF-16 without mark": plain().encode("utf-16-le"),
    "units in a row, tabs": units_row("\t", ".").encode("cp1252"),
    "MoTeC": motec().encode("cp1252"),
    "AiM": _AIM + table(quoted=True),
    "CarMaker .dat": carmaker_dat(),
    "CarMaker .csv": CARMAKER + table(";"),
    "2D": two_d().encode("cp1252"),
    "VBOX": vbox(),
    "milliseconds told": stamped(lambda t: f"{1000 * t:.0f}", "Time [ms]"),
    "milliseconds by their steps": stamped(lambda t: f"{1000 * t:.0f}"),
    "nanoseconds": stamped(lambda t: f"{round(1e6 * t) * 1000}", "timestamp"),
    "epoch in s": stamped(lambda t: f"{1684592000 + t:.3f}", "timestamp"),
    "epoch in ms": stamped(lambda t: f"{1684592000000 + round(1000 * t)}"),
    "epoch in us": stamped(lambda t: f"{1684592000000000 + round(1e6 * t)}"),
    "epoch in ns": stamped(lambda t: f"{1684592000000000000 + round(1e9 * t)}"),
    "ISO 8601": stamped(iso),
    "ISO 8601 with zone": stamped(lambda t: iso(t).replace("T", " ") + "+02:00"),
    "time of day": stamped(clock),
    "over midnight": stamped(lambda t: clock(t, 86399.5)),
    "minutes and seconds": stamped(lambda t: f"{int(t + 59.5) // 60:02d}:{(t + 59.5) % 60:06.3f}"),
    "rounded to 0.1 s": stamped(lambda t: rounded(t, 0.1)),
    "a typographic minus": plain(";", ",").replace("-", "\u2212"),
    "an en dash": plain("\t").replace("-", "\u2013").encode("cp1252"),
    "wide blanks": stamped(lambda t: f"{1000 * t:_.0f}".replace("_", "\u202f"), "Time\u00a0[ms]")
    .encode("utf-16"),
    "Fortran": fortran(),
    "units twice, remarks": renamed(TWICE),
    "names and units in lines": described("Channel : {1}\nUnit : {2}\nID : 7").encode("utf-8-sig"),
    "names in numbered comments": described("# Column {0} = {1} [{2}]"),
    "comments": plain().replace("\n", "\n# a comment, with, commas\n", 1),
}  # fmt: skip
DIALECTS = {k: one.encode() if isinstance(one, str) else one for k, one in _TEXTS.items()}
