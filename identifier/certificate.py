"""One line of a certificate, and the verdict over all of them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Status = Literal["pass", "warn", "fail"]
Verdict = Literal["pass", "warn", "fail", "not certified"]
_NOT_CERTIFIED: Verdict = "not certified"
_SEVERITY: tuple[Status, ...] = ("pass", "warn", "fail")


@dataclass(frozen=True, slots=True, kw_only=True)
class Property:
    """A property of a design, its limit, and what to do.
    limit : what the value is held against; None where it is a statement only.
    margin : distance from the limit: a ratio (1 is the limit), a difference where that is 0.
    advice : one line; empty where there is nothing to say.
    """

    name: str
    title: str
    value: float
    limit: float | None
    margin: float | None
    status: Status
    unit: str
    advice: str = ""

    @classmethod
    def judged(
        cls,
        name: str,
        title: str,
        value: float,
        unit: str,
        *,
        limit: float,
        bad: float | None = None,
        least: bool = False,
        advice: str = "",
    ) -> "Property":
        """Return what passes up to its limit, or down to it, and has advice where it does not.
        bad : beyond which it fails, None for never.   least : whether the limit is the least value.
        """
        status = (at_least if least else at_most)(value, good=limit, bad=bad)
        margin = value / limit if least else limit / value if value else math.inf
        advice = "" if status == "pass" else advice
        return cls(
            name=name, title=title, value=value, limit=limit, margin=margin, status=status,
            unit=unit, advice=advice,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Certificate:
    """All properties of a design, and its limits by construction.
    properties : in the order of the table; none where nothing is proven of stability and errors.
    limits : enforced after every sample, for any measurement, by name and unit: plain data.
    """

    properties: tuple[Property, ...] = ()
    limits: Mapping[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """The worst status; "not certified" without a property."""
        if not self.properties:
            return _NOT_CERTIFIED
        return max((entry.status for entry in self.properties), key=_SEVERITY.index)

    def __repr__(self) -> str:
        counts = f"{len(self.properties)} properties, {len(self.limits)} limits hold"
        return f"<Certificate: {self.verdict}; {counts}>"

    def __str__(self) -> str:
        lines = [f"{e.status}: {e.title}: {e.value:.4g} {e.unit}".rstrip() for e in self.properties]
        lines += [f"limits by construction: {name}: {value}" for name, value in self.limits.items()]
        return "\n".join([*lines, f"verdict: {self.verdict}"])

    def __getitem__(self, name: str) -> Property:
        for entry in self.properties:
            if entry.name == name:
                return entry
        raise KeyError(f"no property {name!r}, there are {[p.name for p in self.properties]}")

    def to_dict(self) -> dict[str, object]:
        """Return plain data for JSON; a number that is not finite becomes None."""
        return {
            "verdict": self.verdict,
            "properties": {
                entry.name: {
                    "value": _finite(entry.value),
                    "limit": _finite(entry.limit),
                    "margin": _finite(entry.margin),
                    "status": entry.status,
                    "unit": entry.unit,
                    "title": entry.title,
                    "advice": entry.advice,
                }
                for entry in self.properties
            },
            "limits": dict(self.limits),
        }


def at_most(value: float, *, good: float, bad: float | None) -> Status:
    """Pass up to `good`, warn up to `bad`, fail beyond (never, where `bad` is None).
    value : to be judged; nan fails.   bad : largest value that only warns.
    """
    if value <= good:
        return "pass"
    return "warn" if bad is None or value <= bad else "fail"


def at_least(value: float, *, good: float, bad: float | None) -> Status:
    """Pass down to `good`, warn down to `bad`, fail below (never, where `bad` is None).
    value : to be judged; nan fails.   bad : smallest value that only warns.
    """
    if value >= good:
        return "pass"
    return "warn" if bad is None or value >= bad else "fail"


def statement(
    name: str, title: str, value: float, unit: str, advice: str = "", status: Status = "pass"
) -> Property:
    """Return a property that is only stated: it has no limit."""
    return Property(
        name=name, title=title, value=value, limit=None, margin=None, status=status, unit=unit,
        advice=advice,
    )  # fmt: skip


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
