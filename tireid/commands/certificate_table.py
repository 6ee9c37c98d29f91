"""A certificate as a person reads it: a table with a line of advice for what does not pass."""

import math

import numpy as np

from identifier.certificate import Certificate, Property
from identifier.driving import Driving
from identifier.methods import LIVE
from identifier.setup import force_unit_name
from models.vehicle import Vehicle
from tireid.output import text_table


def certificate_text(certificate: Certificate, force_unit: float) -> str:
    """Return the certificate as lines of text, ending with advice and the verdict.

    force_unit : the unit U of the design [N].
    """
    rows = [["property", "value", "limit", "margin", ""]]
    for entry in certificate.properties:
        numbers = map(number, (entry.value, entry.limit, entry.margin))
        status = entry.status if entry.limit is not None else "stated"
        rows.append([f"{entry.title} [{unit_text(entry.unit, force_unit)}]", *numbers, status])
    lines = [text_table(rows, "<>>><")]
    lines += [f"{e.status}: {e.title}: {e.advice}" for e in advised(certificate)]
    titles: dict[str, list[str]] = {}  # of values that are only stated, by what is said of them
    for entry in certificate.properties:
        for remark in entry.advice.split("; ") if entry.limit is None and entry.advice else ():
            titles.setdefault(remark, []).append(entry.title)
    lines += [f"note: {remark} ({' | '.join(about)})" for remark, about in titles.items()]
    return "\n".join([*lines, f"verdict: {certificate.verdict}"])


def method_text(name: str, certificate: Certificate, vehicle: Vehicle, driving: Driving) -> str:
    default = ", the default in a car" if name == LIVE else ""
    rows = [
        [f"  {title}", " to ".join(number(one) for one in np.atleast_1d(value))]
        for title, value in certificate.limits.items()
    ]
    lines = [f"{vehicle.name}: {name}{default}"]
    if rows:
        lines += ["limits enforced after every sample, by construction, for any measurement:"]
        lines += [text_table(rows)]
    else:
        lines += ["no limits are enforced by construction"]
    if certificate.properties:
        conditions = f"at {driving.v_x:.3g} m/s on a friction of {driving.friction:g}"
        lines += [f"proven, of drops of friction {conditions}:", certificate_text(certificate, 1.0)]
        return "\n".join(lines)
    return "\n".join(
        [
            *lines,
            f"verdict: {certificate.verdict}; no margin and no bound of its error is proven, of "
            f"{LIVE}, the default in a car, there are: tireid check",
        ]
    )


def advised(certificate: Certificate) -> list[Property]:
    return [e for e in certificate.properties if e.advice and e.status != "pass"]


def verdict_line(certificate: Certificate) -> str:
    gain, phase = certificate["gain_sampled"], certificate["phase_margin"]
    worst = [e.title for e in certificate.properties if e.status == certificate.verdict]
    reason = "" if certificate.verdict == "pass" else f" ({'; '.join(worst)})"
    return (
        f"certificate: {certificate.verdict}{reason}; sampled gain margin {number(gain.margin)}, "
        f"phase margin {phase.value:.0f} deg, damping {certificate['damping'].value:.2f}"
    )


def unit_text(unit: str, force_unit: float) -> str:
    """Return a unit with the force unit written out, kN or N where it is one.

    force_unit : U [N].
    """
    name = force_unit_name(force_unit)
    return " ".join(name if word == "U" else word for word in unit.split())


def number(value: float | None) -> str:
    """Return four significant digits, a dash for none, "inf" for infinity."""
    if value is None or math.isnan(value):
        return "-"
    return "inf" if math.isinf(value) else f"{value:.4g}"
