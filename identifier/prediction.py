"""A recording as a frozen model predicts it, and the verdict on that."""

from dataclasses import dataclass
from functools import cached_property

from codegen.arrays import Array
from identifier.band import UNCALIBRATED
from identifier.day import Day
from identifier.evidence import MotionError, motion_error
from identifier.measured import with_doubt
from identifier.reproducibility import AxleRmse, axle_rms, counted_samples
from identifier.tire_model import TireModel
from identifier.verdict import RoadFriction, Verdict, friction_of, judge_prediction
from identifier.verdict.verdict import LARGEST_MODEL_ERROR
from models.recordings import Recording


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Prediction:
    """One recording as a frozen model predicts it.

    Parameters
    ----------
    axle_force : forces of the frozen model (n, 2) [N].
    against_truth : error over the samples that count, against the true force; None without truth.
    true_force : root mean square of the true force over the same samples, None without truth.
    motion : what the forces miss of the measured motion; None where the recording is too short.
    """

    model: TireModel
    recording: Recording
    axle_force: Array
    against_truth: AxleRmse | None
    true_force: AxleRmse | None
    motion: MotionError | None

    def __repr__(self) -> str:
        name, error, size = self.recording.name, self.against_truth, self.true_force
        if error is None or size is None:
            given = "" if self.motion is None else f"; {self.motion_text()}"
            return f"<Prediction of {name!r}: no true forces to compare with{given}>"
        front, rear = 100.0 * error.front / size.front, 100.0 * error.rear / size.rear
        return (
            f"<Prediction of {name!r}: {with_doubt(error.front)} / {with_doubt(error.rear)} N rms "
            f"error, {front:.1f} / {rear:.1f} % of the force, front / rear>"
        )

    @cached_property
    def day(self) -> Day | None:
        """Errors of this log's sensors, taken off; None of a model that finds none."""
        return self.model.on(self.recording)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the model reproduces the drive's motion; computed once."""
        return judge_prediction(self.model, self.recording)

    def friction(self) -> RoadFriction | None:
        """Return the friction of the drive's road over that of the identification drive, over time.

        None where the model has no band, or too little is driven. The verdict asks for it where the
        model misses some of the motion.

        Raises
        ------
        ValueError
            Where the band of the model is not calibrated: its errors would look like friction.
        """
        if self.model.band is not None and not self.model.band.calibrated:
            raise ValueError(f"friction() wants a calibrated band; this one is {UNCALIBRATED}")
        return self.verdict.friction or friction_of(self.model, self.recording)

    def motion_text(self) -> str:
        """Return what the forces explain of the motion, in a line; empty where unknown.

        Yaw is left out where its moment is a smaller share of that of an axle than a valid model
        may miss.
        """
        motion = self.motion
        if motion is None:
            return ""
        m, I_z, l_f, l_r = self.model.vehicle.bicycle[:4]
        moment = m * l_f * l_r / (l_f + l_r) * motion.lateral_rms
        small = 0.0 < I_z * motion.yaw_rms < LARGEST_MODEL_ERROR * moment
        parts = zip(("lateral", "yaw")[: 2 - small], motion.explained, strict=False)
        shares = [
            f"{f'{100.0 * share:.1f} %' if share > 0.0 else 'nothing'} of the {name}"
            for name, share in parts
            if share is not None
        ]
        said = f"explained are {' and '.join(shares)} acceleration" if shares else ""
        why = "the yaw moment is a small difference of the axle forces of this car"
        return said + f"; {why}: the yaw acceleration cannot check the model" * small


def predict(model: TireModel, recording: Recording, *, since: float | None = None) -> Prediction:
    """Replay a recording with frozen weights and compare with its true forces, where it has any.
    model : the frozen model; samples below its minimum speed do not count.
    since : samples before this time [s] do not count; None counts all.
    """
    force = model.predict(recording)
    counted = counted_samples(recording, model.min_speed, since)
    truth = recording.axle_force
    return Prediction(
        model=model,
        recording=recording,
        axle_force=force,
        against_truth=None if truth is None else axle_rms(force, counted, truth),
        true_force=None if truth is None else axle_rms(truth, counted),
        motion=motion_error(force, recording, model.vehicle, counted),
    )
