"""What the demo drives: the sedan learns on a slalom with sensor noise and is asked elsewhere.

It learns while it drives: with the axle identifier, the default in a car, and with the paper's.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identifier.certificate import Certificate
from identifier.method import Method
from identifier.methods import LIVE, REFERENCE, certify, make_method
from identifier.paper.design import PaperIdentifier
from identifier.reproducibility import force_rms, online_error
from identifier.run import identify
from models.maneuvers import DoubleLaneChange, Maneuver, Slalom, StepSteer
from models.plant import Plant
from models.recordings import Recording
from models.sensors import Sensor, Sensors
from models.vehicle import Vehicle, sedan
from tireid.identified import Results
from tireid.output import text_table

# Drives of a plant that methods are compared on: the first to learn on, the others to predict.

SPEED = 20.0  # m/s
FREEZE = 30.0  # s, the end of the first drive
RATE_LIMIT = np.radians(30.0)  # rad/s at the road wheels
SENSORS = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002))  # m/s and rad/s, rms
SLALOM = Slalom(
    amplitude=np.radians(4.0), frequency=0.5, onset=2.0, rate_limit=RATE_LIMIT, duration=30.0
)
_LANE_CHANGE = DoubleLaneChange(
    amplitude=np.radians(4.5),
    frequency=0.6,
    pause=1.0,
    onset=2.0,
    rate_limit=RATE_LIMIT,
    duration=10.0,
)
_STEP = StepSteer(amplitude=np.radians(4.0), onset=2.0, rate_limit=RATE_LIMIT, duration=8.0)
_FASTER = replace(SLALOM, amplitude=np.radians(3.5), frequency=0.6, duration=20.0)
_Maneuvers = Mapping[str, tuple[Maneuver, float]]  # and the speed [m/s]
STORY: _Maneuvers = {  # to learn on is the first
    "slalom": (SLALOM, SPEED),
    "double_lane_change": (_LANE_CHANGE, SPEED),
    "step_steer": (_STEP, SPEED),
}
DRIVES: _Maneuvers = {
    "slalom_20": (SLALOM, 20.0),
    "step_steer": (_STEP, 20.0),
    "lane_change": (_LANE_CHANGE, 20.0),
    "slalom_25": (_FASTER, 25.0),
}


class Story(NamedTuple):
    """The demo's drives, learnt by the axle identifier and by the paper's beside it."""

    car: Vehicle
    design: PaperIdentifier
    axle: Results
    paper: Results

    @property
    def certificate(self) -> Certificate:
        """What is known of the paper's design before the car drives."""
        return certify(self.design, self.car)

    def rows(self) -> list[list[str]]:
        """Return by drive, for axle and paper: online and frozen error, share of the force."""
        rows: dict[str, list[str]] = {}
        for method in (self.axle, self.paper):
            for run in method.runs:
                name = run.recording.name
                frozen = method.replays[name].against_truth
                online, size = online_error(run), force_rms(run)
                assert size is not None and frozen is not None and online is not None
                cells = [f"{one.both / 1e3:.3f}" for one in (online, frozen)]
                share = f"{100.0 * frozen.both / size.both:.0f} %"
                rows.setdefault(name, [name]).extend([*cells, share])
        return list(rows.values())

    def text(self) -> str:
        cells = ["online", "frozen", "of rms"]
        head = ["drive", *(f"{who} {what}" for who in ("axle,", "paper,") for what in cells)]
        return (
            "Frozen after the slalom, on validation drives: RMSE [kN]; the axle identifier and the "
            "paper's (network, integral law)\n"
            + text_table([head, *self.rows()], "<>>>>>>", indent="  ")
        )


def run_story(progress: Callable[[], None] = lambda: None) -> Story:
    """Drive, learn, freeze and predict, with both methods."""
    car = sedan()
    recordings = plant_recordings(car, np.random.default_rng(1), STORY)
    design = PaperIdentifier.for_vehicle(car)

    def learnt(law: str, method: Method) -> Results:
        runs = []
        for recording in recordings:
            runs.append(identify(recording, car, method))
            progress()
        return Results.learnt(law, runs, [FREEZE], recordings[1:])

    axle, paper = learnt(LIVE, make_method(LIVE, car)), learnt(REFERENCE, design)
    return Story(car, design, axle, paper)


def drive_to_learn() -> Recording:
    """Return the story's drive that the methods learn on."""
    return plant_recordings(sedan(), np.random.default_rng(1), {"slalom": STORY["slalom"]})[0]


def plant_recordings(
    vehicle: Vehicle,
    rng: np.random.Generator,
    drives: _Maneuvers = DRIVES,
) -> tuple[Recording, ...]:
    """Drive the plant of a vehicle through every maneuver.

    rng : of the noise of `SENSORS`.   drives : maneuver and speed [m/s].
    """
    plant = Plant(vehicle)
    return tuple(
        plant.simulate(maneuver, speed=speed, name=name).recording(SENSORS, rng)
        for name, (maneuver, speed) in drives.items()
    )
