"""Learning from a recording and asking what was learnt about another, as commands and users do."""

import logging
from collections.abc import Callable
from dataclasses import replace

from identifier.doctor import diagnose
from identifier.estimate.method import FitMethod
from identifier.estimate.model import FittedModel
from identifier.estimate.poor import on_time
from identifier.inertial import InertialIdentifier
from identifier.method import Method
from identifier.methods import make_method
from identifier.prediction import Prediction, predict
from identifier.reproducibility import counted_samples, freeze_key
from identifier.run import DivergedError
from identifier.run import identify as run_over
from identifier.tire_model import TireModel
from models.recordings import Recording, check_against_vehicle
from models.rules import require_kind
from models.vehicle import Vehicle
from tireid.run import Run

log = logging.getLogger("tireid.doctor")

# How to make what a door wants, for who hands it something else.
_RECORDING = "as of read_recording"
_VEHICLE = "as of Vehicle.from_toml or sedan"
_METHOD = 'as of make_method("axle", vehicle), or a name of methods()'
_TIRE = "as of Run.tire or TireModel.load"


def identify(
    recording: Recording,
    vehicle: Vehicle,
    method: Method | str | None = None,
    *,
    start: TireModel | None = None,
    check: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Learn the tires of a car from a drive.

    What the doctor finds wrong with the drive or the car, and that matters, is logged as warnings
    of "tireid.doctor", each with its finding as `record.finding`; nothing is repaired: `diagnose`
    returns the same with its repair.

    Parameters
    ----------
    recording : what was driven; its axle forces are not looked at.
    vehicle : the car that drove.
    method : the identifier, or its name as of `methods`, which describes each ("integral" is the
        paper's); None takes `FitMethod.for_vehicle` at the recording's interval, which estimates
        v_y where the recording has none.
    start : model to go on learning from; None begins afresh.
    check : whether what this vehicle cannot have driven is refused, and the doctor asked.
    progress : called now and then with the share that is done, 0 to 1.

    Returns
    -------
    Run
        With verdict, tires and the forces over time.

    Raises
    ------
    RecordingError
        Where the recording contradicts the vehicle.
    DivergedError
        Where the method runs away.
    NeverDrivesError
        Where the car never drives.
    ValueError
        Where recording and method differ in their sampling interval, or nothing has that name.
    TypeError
        Where an argument is of another kind.

    Examples
    --------
    >>> import tireid as ti
    >>> run = ti.identify(ti.sample_recording(), ti.sedan())
    >>> run.verdict.word
    'valid'
    >>> force = run.tire.force(0.05, "front")  # [N]
    """
    require_kind(Recording, _RECORDING, recording=recording)
    require_kind(Vehicle, _VEHICLE, vehicle=vehicle)
    if isinstance(method, str):
        method = make_method(method, vehicle)
    design = FitMethod.for_vehicle(vehicle, dt=recording.dt) if method is None else method
    require_kind(Method, _METHOD, method=design)
    if check:
        check_against_vehicle(recording, vehicle)
        for finding in diagnose(recording, vehicle).findings:
            if finding.matters:
                log.warning("%s: %s", recording.name, finding.text, extra={"finding": finding})
    counted_samples(recording, design.min_speed)  # refuses a car that never drives
    history = run_over(recording, vehicle, design, start, progress=progress)
    for note in history.recording.notes[len(recording.notes) :]:  # of a poor v_y
        log.warning("%s: %s", recording.name, note)
    if history.diverged_at is not None:
        at = freeze_key(history.diverged_at)
        law = getattr(design, "law", type(design).__name__)
        raise DivergedError(f"{recording.name}: the method {law} diverged at {at} s")
    return Run(history=history)


def replay(recording: Recording, tire: TireModel, *, since: float | None = None) -> Prediction:
    """Predict the axle forces of a drive and compare them with its true ones, where it has any.

    Parameters
    ----------
    recording : another drive; samples below the model's minimum speed do not count. Where it has
        no v_y, `tire` estimates it, or the inertial identifier, beginning with `tire`.
    tire : the identified tires.
    since : samples before this time [s] do not count; None counts all.

    Raises
    ------
    NeverDrivesError
        Where no sample counts.
    TypeError
        Where an argument is of another kind.
    """
    require_kind(Recording, _RECORDING, recording=recording)
    require_kind(TireModel, _TIRE, tire=tire)
    return predict(tire, with_v_y(recording, tire), since=since)


def with_v_y(recording: Recording, tire: TireModel) -> Recording:
    """Return a drive with its v_y, or with that which the tires or a filter estimate.

    For tires of a fit the delay of a v_y that is rare or noisy is removed, as the fit reads it.

    Parameters
    ----------
    tire : where it estimates no v_y, the inertial identifier does, beginning with it where it can.

    Raises
    ------
    RecordingError
        Where there is no a_y to estimate from.
    """
    if recording.v_y is not None:
        return on_time(recording, tire.vehicle) if isinstance(tire, FittedModel) else recording
    found = tire.estimated_v_y(recording)
    if found is not None:
        return replace(recording, v_y=found.v_y, estimated=("v_y",))
    design, start = InertialIdentifier.beginning_with(tire, tire.vehicle, dt=recording.dt)
    return run_over(recording, tire.vehicle, design, start).recording
