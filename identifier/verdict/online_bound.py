"""Which curves a drive leaves possible, while it is driven: one ellipsoid an axle, cut by moments.

The moments are those of `strips_of`: whoever takes the samples one by one is left with the
ellipsoids that the recording leaves (`outer_ellipsoid`). Slip, β and ρ are of a frozen model. A
sample costs the step of that model, a moment two cuts; what is kept does not grow.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from codegen import Stepper
from codegen.arrays import Array
from identifier.axle.car import Car, axle_impulse, car_numbers
from identifier.axle.curve import unit_matrix
from identifier.axle.ellipsoid import Ellipsoid
from identifier.axle.guarantee import MEMORY, ForceBound, beyond_driven
from identifier.axle.model import AxleModel
from identifier.verdict.guaranteed import OVERLAPPING, least_speed, triangle
from identifier.verdict.motion import WINDOW
from models.vehicle import GRAVITY


class _Sample(NamedTuple):
    """ξ (2,) [s], v_x r/g, λ tanh(x/α_j) (2, n), cos δ (2,), β (2,), ρ (2,) [1/s]; if it counts."""

    impulse: Array
    sideways: float
    units: Array
    cos_delta: Array
    beyond: Array
    rate: Array
    counts: bool


class OnlineBound:
    """Bounds of the forces that a drive so far leaves possible.

    Attributes model, bound, dt; `left` holds the ellipsoid of each axle, None once no curve keeps
    the bound.

    Parameters
    ----------
    model : frozen; its lag, sway and offsets make the slip.
    bound : of the errors: their size [static axle loads] of both axles, or a `ForceBound`.
    dt : interval at which `update` is called [s].

    Raises
    ------
    ValueError
        Where the bound is impossible, or the interval not positive and finite.
    """

    def __init__(self, model: AxleModel, bound: float | ForceBound, dt: float) -> None:
        if not 0.0 < dt < math.inf:
            raise ValueError(f"dt must be positive and finite, it is {dt}")
        self.model, self.bound, self.dt = model, ForceBound.of(bound), dt
        first = Ellipsoid.around(len(model.ladder))
        self.left: list[Ellipsoid | None] = [first, first]
        self._n = max(2, round(WINDOW / dt))
        self._g, self._slope = triangle(self._n, dt)
        self._car = Car(*car_numbers(model.vehicle).T)
        self._setup = model.setup(dt)
        self._begin()

    def _begin(self) -> None:
        """Forget the moment, not the ellipsoids: nothing is differenced over a gap."""
        self._stepper = Stepper(self._setup.scan, {**self._setup.carry, **self._setup.constants})
        self._moment: deque[_Sample] = deque(maxlen=self._n + 1)
        self._newest: _Sample | None = None
        self._mean, self._taken = np.zeros(2), 0

    @property
    def violated(self) -> tuple[bool, bool]:
        """Whether no curve of front and rear axle keeps the bound: then it does not hold."""
        front, rear = self.left
        return front is None, rear is None

    def update(self, x: Array, u: Array, v_x: float) -> None:
        """Take a sample; a moment that is complete with the one before it cuts the ellipsoids.

        A number that is not finite is a gap.

        Parameters
        ----------
        x : [v_y, r] (2,) [m/s, rad/s].
        u : [δ_f, δ_r] (2,), angles of the road wheels [rad].
        v_x : longitudinal speed [m/s].
        """
        if not (np.isfinite(x).all() and np.isfinite(u).all() and math.isfinite(v_x)):
            self._begin()
            return
        before, self._newest = self._newest, self._measured(x, u, v_x)
        if before is None:
            return
        self._complete(before, self._newest.units)
        first = self._taken - 1 - self._n  # sample with which the moment begins
        if first >= 0 and first % max(1, self._n // OVERLAPPING) == 0:
            self._cut()

    def _measured(self, x: Array, u: Array, v_x: float) -> _Sample:
        """Return what a sample shows; its ρ needs the next one."""
        model, inputs = self.model, self._stepper.inputs
        inputs["x"][:], inputs["u"][:], inputs["v_x"][:] = x, u, v_x
        self._stepper.advance()
        slip = self._stepper.outputs["lagged_slip"]
        over = beyond_driven(slip, model.driven_slip)
        fading = math.exp(-self.dt / MEMORY)
        last = np.zeros(2) if self._newest is None else self._newest.beyond
        return _Sample(
            impulse=axle_impulse(self._car, x[0], x[1]),
            sideways=v_x * x[1] / GRAVITY,
            units=unit_matrix(slip, model.ladder) * model.vehicle.load_ratio(v_x)[:, None],
            cos_delta=np.cos(u),
            beyond=np.maximum(over, fading * last),
            rate=np.zeros(2),
            counts=v_x >= least_speed(model),
        )

    def _complete(self, sample: _Sample, following: Array) -> None:
        """Add a sample to the moment, with ρ by its neighbors' units."""
        steps = 2.0 if self._moment else 1.0
        last = self._moment[-1].units if self._moment else sample.units
        change = np.einsum("ij,ij->i", following - last, self.model.W)
        now, fading = np.abs(change) / (steps * self.dt), math.exp(-self.dt / MEMORY)
        self._mean = fading * self._mean + (1.0 - fading) * now if self._moment else now
        self._moment.append(sample._replace(rate=np.maximum(now, self._mean)))
        self._taken += 1

    def _cut(self) -> None:
        """Cut both ellipsoids by the moment, where the car drives throughout."""
        if not all(sample.counts for sample in self._moment):
            return
        impulse, sideways, units, cos_delta, beyond, rate, _ = (
            np.array(values) for values in zip(*self._moment, strict=True)
        )
        y = self._slope @ impulse + self._g @ sideways
        h = np.tensordot(self._g, units * cos_delta[..., None], 1)
        allowed = self.bound.allowed(self._g @ beyond, self._g @ rate)
        for axle, known in enumerate(self.left):
            if known is not None:
                self.left[axle] = known.cut(h[axle], float(y[axle]), float(allowed[axle]))

    def band(self, alpha: ArrayLike) -> tuple[Array, Array] | None:
        """Return least and largest steady force at slip angles under static loads, (k, 2) [N].

        None once `violated`.

        Parameters
        ----------
        alpha : slip angles [rad], (k,).
        """
        slip, loads = np.asarray(alpha, dtype=np.float64), self.model.vehicle.axle_loads
        units = unit_matrix(slip, self.model.ladder)
        beyond = beyond_driven(slip[:, None], self.model.driven_slip)
        wide = self.bound.allowed(beyond, np.zeros_like(beyond))
        sides = []
        for known in self.left:
            if known is None:
                return None
            sides.append(known.reach(units))
        low, high = (np.stack(side, axis=1) for side in zip(*sides, strict=True))
        return (low - wide) * loads, (high + wide) * loads
