"""Do the sensors agree? Every channel that teaches is held against others that do not share it.

Observers run beside the car, each a signal predicted from others and pulled to its own measurement
with the rate l; l times what is left, averaged over 1/l, is the disagreement:
    position   (X, Y)' = R(ψ) (v_x, v_y)     along and across the body      [m/s]
    heading    ψ' = r                                                       [rad/s]
    lateral    v_y' = a_y - v_x r                                           [m/s²]
    steering   δ = what was asked of the wheels a delay ago                 [rad]
A bias b of v_y shows as b (1 - (1 + l t) exp(-l t)) across, so that one of twice the tolerance is
seen after 1.7/l. A channel that is stuck, flipped, scaled or noisy breaks the same relations.
"""

import math
from typing import NamedTuple

from models.sensors import LARGEST_MEASURED, is_measured
from mpc.loop.sensing import Measured

# How far good sensors may disagree.
RATE = 5.0  # [1/s] l, at which an observer is pulled to its measurement
ALONG = 0.2  # [m/s] of v_x against the position, and ...
ALONG_SHARE = 0.02  # ... for each m/s of speed [-]: a wheel's radius is known to about that
ACROSS = 0.15  # [m/s] of v_y against the position
HEADING = 0.02  # [rad/s] of r against the heading
LATERAL = 0.6  # [m/s²] of v_y against a_y and v_x r
STEERING = 0.01  # [rad] of δ against what was asked, and ...
STEERING_TIME = 0.03  # ... for each rad/s of steering [s]: the lag is known to about that
# Time of agreement after which learning goes on [s]. It doubles each time a disagreement comes back
# within RELAPSE of agreement, and to no more than that [s].
CALM = 0.5
RELAPSE = 10.0


class Residual(NamedTuple):
    """The worst relation: its name, what is left of it, and that over what is tolerated."""

    relation: str
    value: float
    unit: str
    share: float

    def __str__(self) -> str:
        return f"{self.relation} disagree by {self.value:.2g} {self.unit}"


_NONE = Residual("", 0.0, "", 0.0)
_NOT_A_NUMBER = Residual("a sensor shows no number: sensors", math.inf, "", math.inf)


class Consistency:
    """Watches the sensors of a car, sample by sample.

    Attributes: agrees, whether they do and did for a while; worst, of the last sample.
    dt : sampling interval [s].
    """

    def __init__(self, dt: float) -> None:
        self._dt, self._calm, self._calm_needed = dt, math.inf, CALM
        self._begin()
        self.agrees, self.worst = True, _NONE

    def _begin(self) -> None:
        self._predicted: tuple[float, ...] | None = None  # X, Y, ψ, v_y as predicted
        self._rates: tuple[float, ...] = ()
        self._means: tuple[float, ...] = (0.0,) * 6
        self._last_requested = 0.0

    def observe(self, measured: Measured, requested: float | None = None) -> bool:
        """Take a sample; return whether the sensors agree.

        requested : angle of the wheels that should have been reached by now [rad]; None where it
        is not known.
        """
        self.worst = self._judged(measured, requested)
        if self.worst.share > 1.0:
            if self.agrees and self._calm < RELAPSE:  # a channel that is bad now and then
                self._calm_needed = min(2.0 * self._calm_needed, RELAPSE)
            self._calm = 0.0
        else:
            self._calm += self._dt
            if self._calm >= RELAPSE:
                self._calm_needed = CALM
        self.agrees = self._calm >= self._calm_needed
        return self.agrees

    def _judged(self, m: Measured, requested: float | None) -> Residual:
        dt = self._dt
        if not all(is_measured(channel, getattr(m, channel)) for channel in LARGEST_MEASURED):
            self._begin()
            return _NOT_A_NUMBER
        cos_psi, sin_psi = math.cos(m.psi), math.sin(m.psi)
        rates = (
            m.v_x * cos_psi - m.v_y * sin_psi,
            m.v_x * sin_psi + m.v_y * cos_psi,
            m.r,
            m.a_y - m.v_x * m.r,
        )
        measured = (m.X, m.Y, m.psi, m.v_y)
        if self._predicted is None:
            self._predicted, self._rates = measured, rates
            self._last_requested = m.delta if requested is None else requested
        # Trapezoidal: half a sample of a turning car is 0.1 m/s across.
        moved = [0.5 * dt * (a + b) for a, b in zip(self._rates, rates, strict=True)]
        predicted = [a + b for a, b in zip(self._predicted, moved, strict=True)]
        residuals = [a - b for a, b in zip(measured, predicted, strict=True)]
        residuals[2] = math.remainder(residuals[2], math.tau)
        self._predicted = tuple(
            x + RATE * dt * e for x, e in zip(predicted, residuals, strict=True)
        )
        self._rates = rates
        along, across = (
            residuals[0] * cos_psi + residuals[1] * sin_psi,
            residuals[1] * cos_psi - residuals[0] * sin_psi,
        )
        steering, turning = self._means[4:]
        if requested is not None:
            steering, turning = m.delta - requested, abs(requested - self._last_requested) / dt
            self._last_requested = requested
        pulled = [RATE * one for one in (along, across, residuals[2], residuals[3])]
        now = (*pulled, steering, turning)
        self._means = tuple(a + RATE * dt * (b - a) for a, b in zip(self._means, now, strict=True))
        along, across, heading, lateral, steering, turning = self._means
        steers = STEERING + STEERING_TIME * turning
        relations = (
            ("v_x and position", along, "m/s", ALONG + ALONG_SHARE * abs(m.v_x)),
            ("v_y, heading and position", across, "m/s", ACROSS),
            ("yaw rate and heading", heading, "rad/s", HEADING),
            ("v_y, a_y and yaw rate", lateral, "m/s²", LATERAL),
            ("steering and what was asked of it", steering, "rad", steers),
        )
        found = [
            Residual(relation, value, unit, abs(value) / most)
            for relation, value, unit, most in relations
        ]
        return max(found, key=lambda one: one.share)
