"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # caution
    n_grips: int = 9  # frictions that are possible
    least_grip: float = 0.25  # of the friction that a tire was learnt on: ice, after a dry road
    surprise: float = 8.0  # -2 ln of how likely a road is to change, as a supervisor has it
    # static axle loads, of 0.2 s of motion: noise, load transfer, transients
    force_error: float = 0.045
    # fall_back
    n_states: int = 5  # e_y, e_psi, v_y, r and the angle of the wheels
    steering: float = 0.2  # rad that cost as much as `e_y`, where the car hardly moves
    digits: int = 9  # of what is exported: other digits depend on the machine
    doublings: int = 40  # at most; ten are usual
    enough: float = 1e-13  # change of the cost, in parts


CHOSEN = Chosen()
