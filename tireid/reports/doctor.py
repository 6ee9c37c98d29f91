"""The report of `tireid doctor`: what is wrong with a log, and what takes it out."""

from pathlib import Path

from matplotlib.figure import Figure

from identifier.doctor import Diagnosis
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid.diagnoses import diagnosis_section, diagnosis_warnings
from tireid.report import Headline, Report, Section, write_report
from tireid.reports.common import READ, REPORT, drawing, origin


def write_doctor_report(
    folder: Path,
    recording: Recording,
    vehicle: Vehicle,
    diagnosis: Diagnosis,
    after: Diagnosis | None,
    figure: Figure,
    *,
    command: str,
) -> None:
    """Write the report of a diagnosis.

    Parameters
    ----------
    folder : where to.
    recording : as it was read.
    vehicle : as it was told.
    diagnosis : of both.
    after : that of the repaired log, None where nothing was repaired.
    figure : of force over slip, before and after.
    command : as it was typed.
    """
    drawn = drawing(figure, "Force over slip angle, as logged and repaired.", READ["doctor"])
    sections = [
        diagnosis_section(diagnosis),
        Section(heading="What the tires say", blocks=[drawn]),
    ]
    if after is not None:
        sections.append(diagnosis_section(after, heading="After the repair"))
    count = len(diagnosis.findings)
    numbers = [
        Headline(str(count), f"finding{'s' * (count != 1)} in the log or the car's file"),
        Headline(str(sum(one.sure for one in diagnosis.findings)), "of them sure, with a repair"),
    ]
    if after is not None:
        numbers.append(Headline(str(len(after.findings)), "left after the repair"))
    report = Report(
        title=f"Diagnosis of {recording.name}",
        summary=f"{recording.duration:.4g} s of driving of {vehicle.name}.",
        numbers=numbers,
        warnings=diagnosis_warnings(diagnosis),
        sections=[*sections, origin(command, vehicle, [recording])],
    )
    write_report(folder / REPORT, report)
