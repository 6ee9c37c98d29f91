"""Running a method over a recording, in compiled code."""

from identifier.history import History
from identifier.method import FrozenModel, Method
from models.recordings import Recording
from models.vehicle import Vehicle


def check_sampling(recording: Recording, design: Method) -> None:
    """Refuse a recording that is not sampled at the design's interval.

    Parameters
    ----------
    recording : what the design is to run over.
    design : the method.

    Raises
    ------
    ValueError
        Where the two differ.
    """
    if abs(recording.dt - design.dt) > 1e-6 * design.dt:
        raise ValueError(
            f"{recording.name} is sampled at {recording.dt:g} s, the design at {design.dt:g} s"
        )


def identify(
    recording: Recording, vehicle: Vehicle, design: Method, start: FrozenModel | None = None
) -> History:
    """Run a method over a recording, sample by sample.

    Parameters
    ----------
    recording : signals, sampled at the design's interval; its forces are not looked at.
    vehicle : the car as the method is told of it.
    design : the method: a `Design` of the paper's identifier, or any other.
    start : stored weights to begin with; None begins afresh.

    Raises
    ------
    ValueError
        Where recording and design differ in their sampling interval.
    """
    check_sampling(recording, design)
    setup = design.setup(vehicle, recording, start)
    record = setup.run(recording)
    return History(
        vehicle=vehicle,
        design=design,
        recording=recording,
        axle_force=record["axle_force"],
        carried={name: record[f"{name}_all"] for name in setup.scan.carry},
        told={name: record[name] for name in setup.scan.outputs if name != "axle_force"},
    )
