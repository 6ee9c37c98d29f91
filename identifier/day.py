"""What the sensors of one log read wrongly: found anew for each log, with the tires held.

Zeros of sensors differ from day to day, tires do not: they must not travel from the log that
identified the tires to another one. A fit estimates them with its own balance
(`identifier.estimate.day`); for a model that does not, `identifier.compare.zeros` does.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from codegen.arrays import Array
from identifier.estimate.priors import Priors
from identifier.measured import with_doubt
from identifier.motion.model import SENSORS, true_signals
from identifier.motion.parameters import INDEX
from models.recordings import Recording
from models.vehicle import Vehicle

NUMBERS = ("steering_zero", "v_y_bias", "v_y_angle", "v_y_lever", "steering_gain")
INSTALLED = ("v_y_lever", "steering_gain")  # stay with the car: about what was identified
WHERE = [INDEX[name] for name in NUMBERS]
ENOUGH = 15.0  # [s] of driving: 10 s, left turns only, made three times the error of none
_FAR = 3.0  # standard deviations of what is expected, beyond which a number is noted
_SIDEWAYS = 0.0045  # [rad] of b/v + β that is noted, and
_SURELY = 5.0  # its standard deviations: 0 of 46 simulated logs, 32 of 32 planted errors
_APART = 0.33  # sd of b/sd_b - β/sd_β, up to which both are apart: 0.7 of what is believed

UNSEPARATED = ": a bias, or its sensor is turned; this log cannot separate them"
_ROWS = (  # title, unit that is printed, per SI, of NUMBERS
    ("zero of the steering", "°", math.degrees(1.0)),
    ("bias of v_y", " m/s", 1.0),
    ("mounting angle of the v_y sensor", "°", math.degrees(1.0)),
    ("place of the v_y sensor ahead of the center of gravity", " m", 1.0),
    ("correction of the steering angle", " %", 100.0),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Day:
    """Errors of the sensors in one log.

    Parameters
    ----------
    value : of `NUMBERS`, SI (5,).
    covariance : of them with the tires held (5, 5).
    expected : what was believed before the log (5,).
    usual : standard deviations of that (5,).
    speed : at which is driven, median [m/s].
    anew : whether the log was long enough; else they are those of the identification drive.
    """

    value: Array
    covariance: Array
    expected: Array
    usual: Array
    speed: float
    anew: bool

    @classmethod
    def of(
        cls,
        value: Array,
        covariance: Array,
        believed: tuple[Array, Array],
        v_x: Array,
        *,
        anew: bool,
    ) -> "Day":
        """Return a day of a log; the others as of the fields.

        Parameters
        ----------
        value : (5,).
        covariance : (5, 5).
        believed : `expected` and `usual`, (5,) each.
        v_x : speeds that count [m/s], (n,).
        """
        speed = float(np.median(v_x)) if v_x.size else 1.0
        expected, usual = believed
        return cls(
            value=value, covariance=covariance, expected=expected, usual=usual,
            speed=max(speed, 1e-3), anew=anew,
        )  # fmt: skip

    def __getitem__(self, name: str) -> float:
        return float(self.value[NUMBERS.index(name)])

    @property
    def sd(self) -> Array:
        """Standard deviations, (5,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def on(self, p: Array) -> Array:
        """Return parameters of the forward model with these errors, (p,).

        Parameters
        ----------
        p : parameters (p,).
        """
        moved = p.copy()
        moved[WHERE] = self.value
        return moved

    def steered(self, zero: float, sd: float) -> "Day":
        """Return it with a zero of the steering that was found with the v_y of a log [rad]."""
        k = NUMBERS.index("steering_zero")
        value, covariance = self.value.copy(), self.covariance.copy()
        value[k], covariance[k], covariance[:, k] = zero, 0.0, 0.0
        covariance[k, k] = sd**2
        return replace(self, value=value, covariance=covariance, anew=True)

    def corrected(self, recording: Recording) -> Recording:
        """Return the log without the errors."""
        return corrected(recording, self.value)

    @property
    def words(self) -> dict[str, str]:
        """Each number with its standard deviation and unit, by its title."""
        return {
            title: f"{with_doubt(factor * float(value), factor * float(sd))}{unit}"
            for (title, unit, factor), value, sd in zip(_ROWS, self.value, self.sd, strict=True)
            if sd > 0.0
        }

    @property
    def line(self) -> str:
        """The numbers in one line."""
        said = ", ".join(f"{title} {words}" for title, words in self.words.items())
        return said if self.anew else f"{said} (of the identification drive)"

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers, SI, ready for JSON."""
        numbers = zip(NUMBERS, self.value.tolist(), self.sd.tolist(), strict=True)
        return {
            "anew": self.anew,
            **{name: {"value": value, "sd": sd} for name, value, sd in numbers},
        }

    @property
    def notes(self) -> tuple[tuple[str, str], ...]:
        """What is larger than expected: code and one line of each."""
        listed, sideways = [], self._sideways()
        if sideways:
            listed.append(("v_y_reads", sideways))
        rows = zip(NUMBERS, _ROWS, self.value - self.expected, self.usual, self.sd, strict=True)
        for name, (title, unit, factor), away, usual, sd in rows:
            if sideways and name in ("v_y_bias", "v_y_angle"):
                continue
            if self.anew and usual > 0.0 and abs(away) > _FAR * math.hypot(usual, sd):
                than = "of the identification drive" if name in INSTALLED else "of a good sensor"
                said = with_doubt(factor * float(away), factor * float(sd))
                text = f"{title}: {said}{unit} from that {than}; the forces allow for it"
                listed.append((name, text))
        return tuple(listed)

    def _sideways(self) -> str:
        where = [NUMBERS.index("v_y_bias"), NUMBERS.index("v_y_angle")]
        b, beta = where
        found = sideways(self.value[where], self.covariance[np.ix_(where, where)], self.speed)
        if found is None or not self.anew:
            return ""
        both = np.array([1.0, -1.0]) / np.maximum(self.usual[where], 1e-12)
        if both @ self.covariance[np.ix_(where, where)] @ both < _APART**2:
            known = ", ".join(f"{_ROWS[k][0]} {self.words[_ROWS[k][0]]}" for k in (b, beta))
            return f"{found[2]}: {known}; the forces allow for it"
        return f"{found[2]}{UNSEPARATED}"


def sideways(errors: Array, covariance: Array, speed: float) -> tuple[float, float, str] | None:
    """Return how much too much v_y reads at a speed, its deviation [m/s], both in words; or None.

    At one speed bias and mounting angle are one error, and each hides behind half of its prior.
    errors, covariance : bias [m/s] and mounting angle [rad] of v_y, (2,), (2, 2).
    speed : median of the log [m/s].
    """
    h = np.array([1.0 / speed, 1.0])
    s, sd = float(h @ errors), math.sqrt(max(float(h @ covariance @ h), 0.0))
    if not abs(s) > max(_SIDEWAYS, _SURELY * sd):
        return None
    said, much = with_doubt(abs(s) * speed, sd * speed), "much" if s > 0.0 else "little"
    text = f"v_y reads {said} m/s too {much} at the median speed of {speed:.3g} m/s"
    return s * speed, sd * speed, text


def corrected(recording: Recording, value: Array) -> Recording:
    """Return a log without errors of its sensors.   value : of `NUMBERS`, SI, (5,)."""
    v_y = recording.logged_v_y
    errors = dict(zip(NUMBERS, value, strict=True))
    p = [float(errors.get(name, 0.0)) for name in SENSORS]
    still = np.zeros(len(recording))
    given = (recording.v_x, still if v_y is None else v_y, recording.r, recording.delta_f)
    _, true_v_y, _, delta = true_signals((*given, 0.0, 0.0, 0.0), p)
    return replace(recording, delta_f=delta, v_y=recording.v_y if v_y is None else true_v_y)


def usual_errors(vehicle: Vehicle) -> Array:
    """Return the standard deviations of sensors that nobody has looked at, (5,)."""
    return Priors.of(vehicle).sd[WHERE]
