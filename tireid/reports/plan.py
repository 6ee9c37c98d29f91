"""The report of `tireid plan`: what to drive, what it will teach, and how safe it is."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from identifier.plan import Plan, Rehearsal, Rival, hold_of
from models.files import digest
from tireid.report import Headline, Paragraph, Report, Section, Table, write_report
from tireid.reports.common import READ, REPORT, drawing, origin

_PULL = 3.0  # m/s², of a car that comes to speed, and of one that stops


def plan_words(found: Plan, driven: Sequence[Rehearsal]) -> list[str]:
    """Return what to expect and what is safe, as sentences."""
    space, count = found.space, len(found.passes)
    each = found.time / count
    times = f"one pass of {each:.1f} s" if count == 1 else f"{count} passes of {each:.1f} s"
    said = [
        f"{times} at {space.speed:.3g} m/s in {space.length:g} x {space.width:g} m: the expected "
        f"error of the forces falls from {100.0 * found.error_before:.0f} to "
        f"{100.0 * found.error:.1f} % of the grip."
    ]
    slalom = found.rivals[0]
    said.append(_against(slalom, found))
    distance = space.speed**2 / (2.0 * _PULL)
    said.append(
        f"Up to {found.lateral_acceleration:.1f} m/s² sideways, {100.0 * space.share:.0f} % of the "
        f"grip of the likely tires; the car stays {found.clearance:.2g} m from the edge with "
        f"every tire that it may have. It comes in at speed, about {distance:.0f} m of run-up, and "
        f"needs as much to stop behind the area."
    )
    if driven:
        side_slip = max(one.side_slip for one in driven)
        said.append(
            f"Rehearsed on the double-track car of the vehicle file: {_least(driven):.2g} m from "
            f"the edge, side slip up to {math.degrees(side_slip):.1f} degrees."
        )
    return said


def _least(driven: Sequence[Rehearsal]) -> float:
    """Return the least distance to the edge in rehearsals [m]."""
    return min(one.clearance for one in driven)


def _against(slalom: Rival, found: Plan) -> str:
    """Return what a slalom would need."""
    later = "is not as good in ten times of it"
    if math.isfinite(slalom.catches_up):
        length = slalom.length * slalom.catches_up / found.time
        later = f"is as good after {slalom.catches_up:.0f} s, {length:.0f} m"
    return (
        f"A slalom at the same share of the grip leaves {100.0 * slalom.error:.1f} % in that time, "
        f"and {later}."
    )


def write_plan_report(
    folder: Path,
    found: Plan,
    figures: Mapping[str, Figure],
    *,
    inputs: Mapping[str, Any],
    command: str,
    driven: Sequence[Rehearsal],
) -> None:
    words = plan_words(found, driven)
    report = Report(
        title=f"Maneuver in {found.space.length:g} x {found.space.width:g} m",
        summary=words[0],
        numbers=[
            Headline(f"{100.0 * found.error:.1f} %", "expected error of the forces over the grip"),
            Headline(f"{100.0 * found.error_before:.0f} %", "before it"),
            Headline(f"{100.0 * found.rivals[0].error:.1f} %", "after a slalom of that length"),
            Headline(f"{found.clearance:.2g} m", "least distance to the edge"),
        ],
        warnings=_plan_warnings(found, driven),
        sections=[
            Section(
                heading="Maneuver",
                blocks=[
                    drawing(figures["area"], "Passes in the area.", READ["plan_area"]),
                    drawing(figures["steering"], "Steering.", READ["plan_steering"]),
                    Paragraph(text=_how(found)),
                ],
            ),
            Section(
                heading="Expected gain",
                blocks=[
                    drawing(
                        figures["band"], "The band of 90 % before and after.", READ["plan_band"]
                    ),
                    Paragraph(text=words[1]),
                    Table(
                        caption="The plan and maneuvers of the same length at the same share of "
                        "the grip, error over the grip; their room is that on an open field, "
                        "without margins; random is the median of eight.",
                        header=RIVALS,
                        rows=rival_rows(found),
                    ),
                ],
            ),
            Section(heading="Safety", blocks=[Paragraph(text=text) for text in words[2:]]),
            origin(
                command,
                found.tires.vehicle,
                (),
                all_inputs=f"hash {digest(dict(inputs))}, listed in summary.json",
            ),
        ],
    )
    write_report(folder / REPORT, report)


def _plan_warnings(found: Plan, driven: Sequence[Rehearsal]) -> list[str]:
    said = [
        "Drive on a closed field only, at half the speed first: tires outside of what was taken "
        "for possible, a wet place or a lower speed change the way."
    ]
    if not found.space.held:
        said.append("Open loop: disturbances of the course are not corrected.")
    if driven and _least(driven) < 0.0:
        said.append(
            f"The double-track car of the vehicle file leaves the area by {-_least(driven):.2g} m: "
            "its tires are outside the planned set. Set --mu, or ask for less --grip."
        )
    return said


def _how(found: Plan) -> str:
    """Return how steering.csv is to be driven."""
    space, lag = found.space, 1e3 * float(found.tires.steering_lag[0])
    paths = "path.csv" if len(found.passes) == 1 else "path.csv, path_2.csv, ..."
    how = (
        "steering.csv has the front wheel angle [rad], to the left positive, over the time since "
        "the entry of each pass, and the course of the center of gravity that follows: X along "
        "the longer side of the area, Y to the left of it, both from the corner in which the "
        f"area begins, psi from X to the left. The wheels follow over {lag:.0f} ms. The speed is "
        f"constant. {paths}: the course with a straight run-up, as tireid drive --path path.csv "
        f"--speed {space.speed:g}m/s and other path trackers read it; who tracks it well steers "
        "much the same."
    )
    if not space.held:
        return how
    hold = hold_of(found.tires, space.speed)
    return (
        f"{how} The robot or driver of steering.csv also corrects the course, slowly: add "
        f"{hold.heading:.3g} rad per rad of heading that is missing and {hold.aside:.3g} rad per "
        "meter that the car is off to the right."
    )


RIVALS = ("maneuver", "time", "room", "expected error")


def rival_rows(found: Plan) -> list[list[str]]:
    """Return the plan beside slalom and random steering, under `RIVALS`."""
    space, time = found.space, f"{found.time:.1f} s"
    room = f"{space.length:g} x {space.width:g} m"
    rows = [["plan", time, room, f"{100.0 * found.error:.1f} %"]]
    for one in found.rivals:
        room = f"{one.length:.0f} x {one.width:.1f} m"
        rows.append([one.name, time, room, f"{100.0 * one.error:.1f} %"])
    return rows
