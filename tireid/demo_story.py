"""What the demo drives: the sedan learns on a slalom with sensor noise and is asked elsewhere."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identifier.defaults import default_design
from identifier.design import Design
from identifier.history import History
from identifier.identify import identify
from identifier.reproducibility import Replay, force_rms, online_error, replay
from identifier.stability import Certificate
from models.maneuvers import DoubleLaneChange, Maneuver, Slalom, StepSteer
from models.plant import Plant
from models.recordings import Recording
from models.sensors import Sensor, Sensors
from models.vehicle import Vehicle, sedan
from tireid.certificate_table import certificate_of

SPEED = 20.0  # m/s
FREEZE = 30.0  # s, the end of the first drive
RATE_LIMIT = np.radians(30.0)  # rad/s at the road wheels
SENSORS = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002))  # m/s and rad/s, rms
LEARN: Maneuver = Slalom(
    amplitude=np.radians(4.0), frequency=0.5, onset=2.0, rate_limit=RATE_LIMIT, duration=30.0
)
PREDICT: Mapping[str, Maneuver] = {
    "double_lane_change": DoubleLaneChange(
        amplitude=np.radians(4.5),
        frequency=0.6,
        pause=1.0,
        onset=2.0,
        rate_limit=RATE_LIMIT,
        duration=10.0,
    ),
    "step_steer": StepSteer(
        amplitude=np.radians(4.0), onset=2.0, rate_limit=RATE_LIMIT, duration=8.0
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Story:
    """The demo's drives and what was learnt on the first.

    Parameters
    ----------
    car : what drives, and what the identifier is told of.
    design : the design that learns.
    learnt : the online run that the weights come from.
    others : online runs over the drives that the frozen model predicts.
    frozen : freeze time [s] to recording name to replay.
    """

    car: Vehicle
    design: Design
    learnt: History
    others: Sequence[History]
    frozen: Mapping[float, Mapping[str, Replay]]

    @property
    def certificate(self) -> Certificate:
        """What is known of the design before the car drives."""
        return certificate_of(self.design, self.car)

    def rows(self) -> list[list[str]]:
        """Return name, online and frozen error of both axles together, and the share of force."""
        rows = []
        for history in (self.learnt, *self.others):
            name = history.recording.name
            frozen, online = self.frozen[FREEZE][name].against_truth, online_error(history)
            size = force_rms(history)
            assert size is not None and frozen is not None and online is not None
            share = 100.0 * frozen.both / size.both
            rows.append(
                [name, f"{online.both / 1e3:.3f}", f"{frozen.both / 1e3:.3f}", f"{share:.0f} %"]
            )
        return rows

    def text(self) -> str:
        """Return the rows as lines of text."""
        lines = ["Frozen after the slalom: RMSE of the axle force [kN], online / frozen / of rms"]
        lines += [f"  {a:20} {b:>8} {c:>8} {d:>6}" for a, b, c, d in self.rows()]
        return "\n".join(lines)


def drives(maneuvers: Mapping[str, Maneuver]) -> dict[str, Recording]:
    """Drive the sedan; sensors are noisy with a fixed seed.

    Parameters
    ----------
    maneuvers : by the name of the recording.
    """
    plant, rng = Plant(sedan()), np.random.default_rng(1)
    return {
        name: plant.simulate(maneuver, speed=SPEED, name=name).recording(SENSORS, rng)
        for name, maneuver in maneuvers.items()
    }


def drive_to_learn() -> Recording:
    """Return the slalom of the demo."""
    return drives({"slalom": LEARN})["slalom"]


def run_story() -> Story:
    """Drive, learn, freeze and predict."""
    car = sedan()
    design = default_design(car)
    recordings = drives({"slalom": LEARN, **PREDICT})
    histories = {name: identify(rec, car, design) for name, rec in recordings.items()}
    model = histories["slalom"].freeze(FREEZE)
    return Story(
        car=car,
        design=design,
        learnt=histories["slalom"],
        others=[histories[name] for name in PREDICT],
        frozen={FREEZE: {name: replay(model, history) for name, history in histories.items()}},
    )
