"""A slalom: cones in a row at equal distances, passed left and right in turn."""

import math

from mpc.path.gates import Gate, cones_of, line_through_gates
from mpc.path.line import PathError
from mpc.path.path import Path

EASING = 6.0  # m


def slalom(
    *,
    gap: float = 18.0,
    cones: int = 8,
    car_width: float = 1.8,
    margin: float = 0.3,
    run_in: float = 40.0,
    run_out: float = 40.0,
    spacing: float = 0.25,
) -> Path:
    """Return the line of smallest peak curvature around the cones, the first of them at the origin.

    The car passes the first cone on its left side, y > 0, and ends on the line that it came from.

    Parameters
    ----------
    gap : distance of the cones [m].
    cones : how many there are.
    car_width : width of the car without mirrors [m].
    margin : room between the side of the car and the cones [m].
    run_in : way before the first cone [m].
    run_out : way after the last cone [m].
    spacing : longest step of the samples [m].

    Raises
    ------
    PathError
        Where a number is out of range.
    """
    if not (cones >= 1 and gap >= 5.0 and math.isfinite(gap)):
        raise PathError(f"a slalom needs a cone and 5 m between them, got {cones} and {gap} m")
    for what, value in (("run_in", run_in), ("run_out", run_out)):
        if not 5.0 <= value <= 1000.0:
            raise PathError(f"{what} must be 5 to 1000 m, it is {value}")
    if not (car_width > 0.0 and margin >= 0.0):
        raise PathError(f"car_width and margin must be positive, they are {car_width}, {margin}")
    gates = [
        Gate(
            start=i * gap,
            end=i * gap,
            right=0.0 if i % 2 == 0 else -math.inf,
            left=math.inf if i % 2 == 0 else 0.0,
        )
        for i in range(cones)
    ]
    line = line_through_gates(
        gates,
        start=(-run_in, 0.0),
        end=((cones - 1) * gap + run_out, 0.0),
        clearance=0.5 * car_width + margin,
        easing=EASING,
        spacing=spacing,
    )
    return Path.from_line(line, name="slalom", cones=cones_of(gates))
