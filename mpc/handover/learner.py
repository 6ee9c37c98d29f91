"""The whole of learning while driving, beside a tracker: observe, decide, move the weights."""

from collections import deque
from collections.abc import Callable

import numpy as np

from mpc.handover.consistency import Consistency
from mpc.handover.rules import Verdict
from mpc.handover.supervisor import Supervisor
from mpc.loop.sensing import Measured
from mpc.realtime import Tracker
from mpc.tires import PredictionTire

_HALVINGS = 6


def blended(
    now: PredictionTire,
    target: PredictionTire,
    share: float,
    *,
    planned: Callable[[PredictionTire], float],
    most: float,
) -> PredictionTire:
    """Return the tire with the next weights on the way to a target; the plan does not jump on it.

    The share is halved until the tracker, asked what it would plan with the weights in the same
    situation, answers within the bound; where no share of the way is small enough, weights stay.

    share : of the way that is left, to go at most [-], in (0, 1].
    planned : first steering rate of the plan that a tire leads to, in one situation [rad/s].
    most : change of it that is allowed [rad/s].
    """
    if now.structure != target.structure:
        raise ValueError(f"weights of {now.structure} cannot move to those of {target.structure}")
    way = target.weights - now.weights
    if not np.any(way):
        return target
    reference = planned(now)
    for _ in range(_HALVINGS):
        tire = target if share >= 1.0 else now._replace(weights=now.weights + share * way)
        if abs(planned(tire) - reference) <= most:
            return tire
        share *= 0.5
    return now


class Learner:
    """Keeps a tracker on the tire that its supervisor names.

    Weights go to a new target within the blending time of the rules, in steps that change the
    planned steering rate by no more than they allow.

    Attributes: supervisor.
    steers : False leaves the tracker its tire, and only watches the road.
    """

    def __init__(self, supervisor: Supervisor, *, steers: bool = True) -> None:
        self.supervisor, self._steers = supervisor, steers
        self._sensors = Consistency(supervisor.identifier.method.dt)
        self._steered: deque[float] = deque()  # what was asked of the wheels, newest last [rad]
        self._left = 0.0  # time in which to arrive [s]
        self._quick = False

    def observe(self, measured: Measured, tracker: Tracker) -> str | None:
        """Take a sample before the tracker steps; return what was decided, where that matters.

        tracker : which steers; its tire is moved.
        """
        agree = self._sensors.observe(measured, self._requested(tracker))
        decision = self.supervisor.observe(
            measured.v_x,
            measured.v_y,
            measured.r,
            measured.delta,
            fault=None if agree else str(self._sensors.worst),
        )
        changed = decision is not None and decision.verdict is not Verdict.KEEP
        if decision is not None and changed:
            rules = self.supervisor.rules
            self._quick = decision.verdict is not Verdict.LEARNT
            self._left = rules.quick_blend if self._quick else rules.blend
        if self._steers:
            self._move(tracker)
        elif decision is not None and decision.verdict is Verdict.LEARNT:
            return None
        return f"{decision.verdict.value}: {decision.reason}" if decision and changed else None

    def _requested(self, tracker: Tracker) -> float | None:
        """Return the angle that the wheels should have by now [rad], None before it is known."""
        ago = tracker.delay / tracker.period
        self._steered.append(tracker.steering)
        if len(self._steered) < ago + 2.0:
            return None
        while len(self._steered) > ago + 3.0:
            self._steered.popleft()
        # The newest was decided a period ago.
        whole, part = divmod(max(ago - 1.0, 0.0), 1.0)
        k = len(self._steered) - 1 - int(whole)
        return self._steered[k] + part * (self._steered[k - 1] - self._steered[k])

    def _move(self, tracker: Tracker) -> None:
        target = self.supervisor.target
        if tracker.tire is target:
            return
        rules = self.supervisor.rules
        most = rules.quick_jump if self._quick else rules.jump
        share = min(1.0, tracker.period / max(self._left, tracker.period))
        tire = blended(tracker.tire, target, share, planned=tracker.previewed_rate, most=most)
        if tire is not tracker.tire:
            tracker.set_tire(tire)
        self._left = max(self._left - tracker.period, tracker.period)
