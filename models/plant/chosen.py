"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # dynamics
    least_speed: float = 1.0  # below this wheel speed slip decays as if at it [m/s]
    # a tire is asked at this load or more, and its force scaled down below it [N]
    least_load: float = 1.0
    # about where a passenger tire has its largest longitudinal force [-]
    largest_kappa: float = 0.1
    n_states: int = 18  # of the car
    load_lag: float = 0.01  # unsprung mass on the tire spring, about 15 Hz [s]
    # plant
    least: float = 0.5  # stiffness over load [1/rad or -]: about 20 of real tires
    most: float = 500.0  # stiffness over load [1/rad or -]
    least_grip: float = 0.05  # largest side force over load [-]: about 1 of real tires
    most_grip: float = 10.0  # largest side force over load [-]


CHOSEN = Chosen()
