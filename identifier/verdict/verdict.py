"""A verdict on a tire model, from the motion alone: no true force is needed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from codegen import markup
from codegen.arrays import Array
from identifier.measured import NOT_IDENTIFIABLE, with_doubt
from identifier.tire_model import Axle
from identifier.verdict.friction import RoadFriction

LARGEST_MODEL_ERROR = 0.12  # share of the force, rms, that the frozen model may miss at an axle
PERCENT = 100.0
BEYOND_KNOWN = "beyond_known"  # code of the finding that a drive slips beyond the identified range

UNOBSERVABLE = (
    "a wrong mass, which scales all forces alike: weigh the car",
    "l_f and l_r where all changes are slow: weigh the axles",
)


WITHOUT_V_Y = (
    "without a measured v_y: l_f and l_r swapped; measure them",
    "without a measured v_y: a scale of the steering, or one of v_x, r or a_y below a fifth, and "
    "delays of a_y or r below 0.1 s: calibrate and align the channels",
)


class Objection(NamedTuple):
    """A finding on a model.
    code : for machines.   axle : that it is about, None for the car or the drive.
    text : what it means and the likely cause, one line.   refuses : whether it makes it not valid.
    silent : whether, for that reason, the drive cannot judge the model.
    """

    code: str
    axle: Axle | None
    text: str
    refuses: bool
    silent: bool = False

    @property
    def line(self) -> str:
        where = f"{self.axle} axle: " if self.axle else ""
        said = "not valid" if self.refuses else "cannot judge" if self.silent else "note"
        return f"{said}: {where}{self.text}"


def drive_judges(found: Sequence[Objection]) -> bool:
    """Return whether a drive with these findings judges a model; one that rejects it does."""
    return any(one.refuses for one in found) or not any(one.silent for one in found)


class Number(NamedTuple):
    """A number of one axle, identified or not.
    sd : its standard deviation ±, None unknown.
    declared : value in the vehicle file or None.   identified : whether the drive decided it.
    valid : whether it is identified, within its bounds, and nothing was found against its axle.
    judged : whether the drive can judge it.
    """

    title: str
    axle: Axle
    value: float
    sd: float | None
    unit: str
    declared: float | None
    identified: bool
    valid: bool
    judged: bool = True

    @property
    def words(self) -> str:
        """Value and standard deviation in three digits."""
        return with_doubt(self.value, self.sd)

    @property
    def state(self) -> str:
        """What it is: "valid", "not valid", "not judged" or "not identifiable from this drive"."""
        if not self.identified:
            return NOT_IDENTIFIABLE
        return "valid" if self.valid else "not valid" if self.judged else "not judged"


class WindowForces(NamedTuple):
    """Forces over the windows that an answer is judged by [N].
    t : middle of each window (m,) [s].   measured : mean force in the motion (m, 2).
    modelled : that of the model (m, 2).   slip : mean of the slip that makes it (m, 2) [rad].
    """

    t: Array
    measured: Array
    modelled: Array
    slip: Array


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Verdict:
    """Whether a model is valid, and the findings.

    Parameters
    ----------
    findings : rejections first.
    numbers : the estimates, each with its standard deviation.
    measures : what was measured on the way, by name, front and rear or one value.
    reach : range of speed and slip that the drives covered, in words; empty where unknown.
    blind : what else is not observable in this drive.
    friction : of the road over that of the identification drive, window by window; None of a run,
        and where not observable.
    forces : in the motion and of the model, window by window; None where too little
        is driven.
    """

    findings: tuple[Objection, ...]
    numbers: tuple[Number, ...]
    measures: Mapping[str, tuple[float, ...] | float | None]
    reach: str = ""
    blind: tuple[str, ...] = ()
    friction: RoadFriction | None = field(default=None, compare=False, repr=False)
    forces: WindowForces | None = field(default=None, compare=False, repr=False)

    @property
    def valid(self) -> bool:
        """Whether the drive judges the model, and no finding rejects it."""
        return self.judged and not any(finding.refuses for finding in self.findings)

    @property
    def judged(self) -> bool:
        """Whether the drive judges the model: False of one that is too short or has no force."""
        return drive_judges(self.findings)

    @property
    def word(self) -> str:
        """The verdict in a word or two: "valid", "NOT VALID" or "cannot judge"."""
        return "valid" if self.valid else "NOT VALID" if self.judged else "cannot judge"

    @property
    def against(self) -> str:
        """How many findings refuse the answer, in words, or why the drive cannot judge it."""
        if not self.judged:
            reason = next(finding for finding in self.findings if finding.silent)
            return reason.text.split(":")[0]
        count = sum(finding.refuses for finding in self.findings)
        return f"{count} finding{'' if count == 1 else 's'} against it"

    @property
    def headline(self) -> str:
        """The verdict in one line."""
        if self.valid:
            return f"verdict: valid for {self.reach}" if self.reach else "verdict: valid"
        return f"verdict: {self.word}, {self.against}"

    @property
    def model_error(self) -> tuple[float, ...] | None:
        """Error of the model over the force in the motion [-], front and rear.

        None where the drive cannot judge.
        """
        found = self.measures.get("force_missed")
        return found if self.judged and isinstance(found, tuple) else None

    @property
    def model_error_line(self) -> str:
        """The same in one line; empty where the drive cannot judge."""
        if self.model_error is None:
            return ""
        front, rear = (f"{PERCENT * share:.1f}" for share in self.model_error)
        return (
            f"model error over the force in the motion: {front} / {rear} % (front / rear, limit "
            f"{PERCENT * LARGEST_MODEL_ERROR:.0f} %)"
        )

    @property
    def unobservable(self) -> tuple[str, ...]:
        """What is not observable, a line each."""
        return tuple(f"not observable: {text}" for text in (*UNOBSERVABLE, *self.blind))

    @property
    def lines(self) -> tuple[str, ...]:
        """Headline, model error, a line for each finding, and what is not observable."""
        error = (self.model_error_line,) if self.model_error_line else ()
        return (self.headline, *error, *(one.line for one in self.findings), *self.unobservable)

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as plain numbers and words, ready for JSON."""
        return {
            "valid": self.valid,
            "judged": self.judged,
            "findings": [finding._asdict() for finding in self.findings],
            "numbers": [number._asdict() | {"state": number.state} for number in self.numbers],
            "measures": dict(self.measures),
            "reach": self.reach,
            "not_observable": [*UNOBSERVABLE, *self.blind],
        }

    def __repr__(self) -> str:
        codes = ", ".join(
            finding.code + (f" ({finding.axle})" if finding.axle else "")
            for finding in self.findings
        )
        return f"<Verdict: {self.word.lower()}{f': {codes}' if codes else ''}>"

    def _repr_html_(self) -> str:
        color = markup.GREEN if self.valid else markup.RED if self.judged else markup.AMBER
        said = self.headline.removeprefix(f"verdict: {self.word}").lstrip(", ")
        return markup.card(
            markup.line(said, self.word, color),
            *map(markup.line, self.lines[1 : -len(self.unobservable)]),
            markup.folded("not observable in this drive", [*UNOBSERVABLE, *self.blind]),
        )
