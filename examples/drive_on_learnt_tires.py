"""Learn the tires of a sedan on a slalom, freeze them, and drive a lane change with them.

The learnt tires say how fast. The tracker is given them, then the linear ones of the vehicle
file; the car, its speed, the noise of its sensors and the delay are the same. Draws
drive_on_learnt_tires.png.
"""

from pathlib import Path

import numpy as np

from identifier.axle import AxleIdentifier
from identifier.run import identify
from identifier.speed_limits import speed_limits
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.drive import drive
from mpc.loop.record import Drive
from mpc.loop.sensing import inertial_unit
from mpc.path import SpeedProfile, iso_3888_2, speed_profile
from mpc.realtime import Tracker
from mpc.tires import PredictionTire, prediction_tire
from tireid.figures.drive import drive_errors_figure
from tireid.figures.style import save_figures

EXPECTED_BELOW = 0.5
SHARE = 0.9  # of what the learnt tires allow
V_MAX = 20.0  # m/s
DELAY = 2  # periods of 10 ms


def steer(tires: PredictionTire, speed: SpeedProfile) -> Drive:
    """Return the drive of a tracker that is given some tires.

    Parameters
    ----------
    tires : what it believes.
    speed : along the path.
    """
    car = DoubleTrackCar(sedan())
    lag = DELAY * car.period + car.vehicle.require_chassis().steering_lag
    return drive(
        speed.path,
        car,
        Tracker(tires, period=car.period, delay=lag),
        speed=speed,
        sensors=inertial_unit(),
        delay=DELAY,
        rng=np.random.default_rng(0),
    )


def main() -> float:
    """Return the rms deviation on learnt tires over that on linear ones [-]."""
    car = sedan()
    slalom = Slalom(amplitude=0.07, frequency=0.5, onset=1.0, rate_limit=0.5, duration=20.0)
    recording = Plant(car).simulate(slalom, speed=20.0).recording()
    history = identify(recording, car, AxleIdentifier.for_vehicle(car))
    learnt = history.freeze(t=20.0)
    speed = speed_profile(iso_3888_2(), speed_limits(learnt), share=SHARE, v_max=V_MAX)
    print(speed)

    tires = {"frozen": prediction_tire(learnt), "linear": prediction_tire(car)}
    drives = {name: steer(one, speed) for name, one in tires.items()}
    rms = {}
    for name, driven in drives.items():
        rms[name] = float(np.sqrt(np.mean(driven.e_y**2)))
        print(f"{name}: rms deviation {100 * rms[name]:.1f} cm, {driven.ending}")
    figure = drive_errors_figure(drives, off_path=2.0)
    save_figures(Path(), {"drive_on_learnt_tires": figure})
    return rms["frozen"] / rms["linear"]


if __name__ == "__main__":
    main()
