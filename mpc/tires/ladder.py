"""Axles as ladders of tanh, lagged or not: the frozen axle model, and any curve fitted by one.

F = Σ_j w_j tanh(α'/α_j) cos δ per axle; lag σ = max(s Σ_j w_j/α_j (1 - tanh²) + σ_0, σ_least).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from identifier.axle.model import AxleModel
from identifier.axle.slip import SHORTEST
from models.vehicle import GRAVITY
from mpc.tires.structure import Array, Pair, Point, TireModel, wheel_slip

N_COMMON = 3
N_AXLE = 2  # beside the w_j


class Axle(NamedTuple):
    """Weights of an axle: compliance s [m/N], least lag [m], w_j [N] (n,)."""

    compliance: Any
    least: Any
    W: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderAxles:
    """Weights: [δ_0, b, σ_0], 1/α_j (n,), then `Axle` in front and at the rear.

    δ_0 [rad]: zero of the steering. b [m/s]: bias of v_y. Both were learnt as offsets of sensors,
    and the tracker reads the same sensors.

    Parameters
    ----------
    units : n of an axle.
    lagged : whether the slip lags; else the lag's weights are there and do nothing.
    """

    units: int
    lagged: bool = True

    @property
    def n_weights(self) -> int:
        """3 + n + 2 (2 + n)."""
        return N_COMMON + self.units + 2 * (N_AXLE + self.units)

    def slip(self, at: Point) -> Pair:
        """Return the slip angles, offsets of the sensors taken off [rad].

        Parameters
        ----------
        at : motion, car and weights.
        """
        front, rear = wheel_slip(self, at._replace(v_y=at.v_y - at.w[1]))
        return front + at.w[0], rear

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body.

        Parameters
        ----------
        slip : what makes the force [rad].
        at : motion, car and weights.
        """
        per_scale, axles = self._weights(at.w)
        front, rear = (
            ca.dot(axle.W, ca.tanh(per_scale * x)) for axle, x in zip(axles, slip, strict=True)
        )
        cos_delta = 1 - at.delta**2 / 2 + at.delta**4 / 24  # as the frozen axle model has it
        return front * cos_delta, rear

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m], which shorten with the slope of the curve.

        Parameters
        ----------
        slip : lagged slip [rad].
        at : motion, car and weights.
        """
        per_scale, axles = self._weights(at.w)
        lengths = []
        for axle, x in zip(axles, slip, strict=True):
            T = ca.tanh(per_scale * x)
            slope = ca.dot(axle.W * per_scale, 1 - T * T)
            lengths.append(ca.fmax(axle.compliance * slope + at.w[2], axle.least))
        return lengths[0], lengths[1]

    def _weights(self, w: Any) -> tuple[Any, tuple[Axle, Axle]]:
        n, size = self.units, N_AXLE + self.units
        start = N_COMMON + n
        front, rear = (w[start + i * size : start + (i + 1) * size] for i in (0, 1))
        return w[N_COMMON:start], (
            Axle(front[0], front[1], front[2:]),
            Axle(rear[0], rear[1], rear[2:]),
        )


def ladder_weights(
    ladder: Array,
    W: Array,
    *,
    compliance: Array,
    least: Array,
    shortest: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Return w of `LadderAxles`.

    Parameters
    ----------
    ladder : α_j [rad], (n,).
    W : w_j [N], front and rear (2, n).
    compliance : s [m/N], (2,).
    least : least lag [m], (2,).
    shortest : σ_0 [m].
    offset : δ_0 [rad] and b [m/s].
    """
    axles = np.column_stack([compliance, least, W])
    return np.concatenate([offset, [shortest], 1.0 / np.asarray(ladder), axles.ravel()])


def axle_tire(model: AxleModel) -> TireModel:
    """Return the prediction tire of a frozen axle model.

    The sway of its body takes k ρ'/(ω² v_x) off the slip, ρ in steady cornering the force of the
    axle over its load times g: the body gives way in series with the carcass, and k g/ω² adds to
    the compliance. That is without the inertia of the roll: ω is above what steering asks for.

    Parameters
    ----------
    model : frozen force curves, their compliance, sway and offsets.
    """
    load, ladder = np.array(model.vehicle.axle_loads), np.array(model.ladder)
    W, shortest = model.W * load[:, None], SHORTEST * model.vehicle.wheelbase
    compliance = (model.own[:, 0] + GRAVITY / model.sway.frequency**2 * model.own[:, 1]) / load
    slope = np.maximum((model.W / ladder).sum(axis=1), 0.1) * load
    weights = ladder_weights(
        ladder,
        W,
        compliance=compliance,
        least=compliance * 0.02 * slope + shortest,  # the slope is held up as when it was learnt
        shortest=shortest,
        offset=(model.own[0, 2], model.own[1, 2]),
    )
    return TireModel(LadderAxles(units=ladder.size), weights, model.vehicle)
