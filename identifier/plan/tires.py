"""Tires and steering that a car may have, as far as is known before it drives: a plan stands all.

Of a car that was never identified: brush tires (as in the prior of the axle identifier) of the
declared stiffness and friction, and those that are softer, stiffer, more slippery or grippier by a
share; the least stable of them steers neutrally on a slippery road. No car is believed to oversteer
at small slip: where the declared rear axle is softer for its load than the front one, both are
taken to be alike. Of a model that was learnt: its own curve, and curves drawn from what learning
left open. The steering follows what is asked of it over the lag of the vehicle file, quicker and
slower ones by the same share: the slow one drives on the least stable tires. A mass that is wrong
is tires of another stiffness per load; it does not count on its own.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from codegen.arrays import Array
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.curve import unit_matrix
from identifier.axle.prior import fiala_weights
from identifier.plan.chosen import CHOSEN
from models.vehicle import Vehicle

STEERING_LAG = 0.04  # s, where no vehicle file tells: that of the sedan's
SLIPS = np.linspace(0.0, 0.5, 501)[1:]  # rad, where curves are looked at


def _steering_lag_of(vehicle: Vehicle, given: float | None) -> float:
    """Return the time constant from the angle asked for to that of the front wheels [s].
    given : of the steering that drives it; None takes that of its chassis, or else 0.04.
    """
    if given is not None:
        return given
    return STEERING_LAG if vehicle.chassis is None else vehicle.chassis.steering_lag


@dataclass(frozen=True, slots=True, kw_only=True)
class PlausibleTires:
    """k cars, the first of which is taken for the truth until more is known.
    W : weights [static axle loads], (k, 2, n).
    steering_lag : of the front wheels behind what is asked of them [s], (k,).
    compliance : [m per load], and share of the sway [-], of all, (2,) each.
    covariance : of all numbers of an axle before the maneuver, (2, n + 3, n + 3).
    prior : that of a car that never drove, (2, n + 3, n + 3).
    """

    vehicle: Vehicle
    method: AxleIdentifier
    W: Array
    steering_lag: Array
    compliance: Array
    sway_share: Array
    covariance: Array
    prior: Array

    @classmethod
    def declared(
        cls, vehicle: Vehicle, friction: float, *, steering_lag: float | None = None
    ) -> Self:
        """Return the tires that a car may have that was never identified.
        friction : believed of tires and road [-].
        """
        method = AxleIdentifier.for_vehicle(vehicle)
        method = replace(method, prior=replace(method.prior, friction=friction))
        ladder, prior = method.ladder, method.prior
        bicycle, loads = vehicle.bicycle, vehicle.axle_loads
        front, rear = bicycle.C_f / loads[0], bicycle.C_r / loads[1]
        neutral = (front * rear) ** 0.5
        if rear < front:
            front = rear = neutral
        low, high = 1.0 - CHOSEN.spread, 1.0 + CHOSEN.spread
        cases = (
            (front, rear, friction, 1.0), (low * front, low * rear, friction, low),
            (high * front, high * rear, friction, high), (neutral, neutral, low * friction, high),
            (front, rear, high * friction, low), (low * front, high * rear, friction, high),
            (low * front, low * rear, low * friction, 1.0),
        )  # fmt: skip
        W = [[fiala_weights(c, mu, ladder) for c in (f, r)] for f, r, mu, _ in cases]
        lag = _steering_lag_of(vehicle, steering_lag) * np.array([late for *_, late in cases])
        P = prior.covariance(vehicle, ladder)
        compliance, share, _ = prior.means(vehicle, ladder)[1].T
        return cls(
            vehicle=vehicle,
            method=method,
            W=np.array(W),
            steering_lag=lag,
            compliance=compliance,
            sway_share=share,
            covariance=P,
            prior=P,
        )

    @classmethod
    def learnt(
        cls, model: AxleModel, rng: np.random.Generator, *, steering_lag: float | None = None
    ) -> Self:
        """Return the tires that a car may have of which a model was learnt."""
        drawn = model.band.samples(CHOSEN.drawn, rng)
        late = 1.0 + CHOSEN.spread * np.array([0.0, *np.resize([-1.0, 1.0], CHOSEN.drawn)])
        return cls(
            vehicle=model.vehicle,
            method=replace(AxleIdentifier.for_vehicle(model.vehicle), ladder=model.ladder),
            W=np.array([model.W, *(one.W for one in drawn)]),
            steering_lag=_steering_lag_of(model.vehicle, steering_lag) * late,
            compliance=model.compliance,
            sway_share=model.sway_share,
            covariance=model.covariance,
            prior=model.prior_covariance,
        )

    @property
    def grip(self) -> Array:
        """Largest force of the curves [static axle loads], (k, 2)."""
        most: Array = self._curves.max(axis=0)
        return most

    def slip_at(self, share: float) -> Array:
        """Return the least slip at which the curves reach a share of their grip [rad], (k, 2).
        share : of the largest force, at most 1.
        """
        reached = self._curves >= share * self.grip
        slips: Array = SLIPS[reached.argmax(axis=0)]
        return slips

    @property
    def _curves(self) -> Array:
        """Forces at `SLIPS`, (501, k, 2)."""
        units = unit_matrix(SLIPS, self.method.ladder)
        curves: Array = np.einsum("sj,kaj->ska", units, self.W)
        return curves

    def at_speed(self, v_x: float) -> Self:
        """Return the tires under the loads of a speed, as curves of that speed.

        Weights, and what is not known of them, are those of the static loads times λ; of a car
        without downforce they stay as they are.
        v_x : speed [m/s].
        """
        load, n = self.vehicle.load_ratio(v_x), len(self.method.ladder)
        unit = np.ones(self.covariance.shape[:2])
        unit[:, :n] = load[:, None]
        both = unit[:, :, None] * unit[:, None, :]
        return replace(
            self,
            W=self.W * load[:, None],
            covariance=self.covariance * both,
            prior=self.prior * both,
        )

    def after(self, covariance: Array) -> Self:
        """Return the same tires when more is known of them.
        covariance : of all numbers of an axle, (2, n + 3, n + 3).
        """
        return replace(self, covariance=covariance)
