"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # curve_ekf
    # C of a passenger tire, Pacejka, Tyre and Vehicle Dynamics, figure 4.9
    typical_shape: float = 1.4
    # of |θ| by kind: stiffness within a factor of 7.4, friction 4.5
    limits: tuple[float, float, float] = (2.0, 3.0, 1.5)
    lag_limit: float = 2.0  # of |ln σ/σ₀|: a relaxation length within a factor of 7.4
    # spreads of δ₀ and of b: 0.01 rad, for a sedan 0.2 m/s
    offset_limits: tuple[float, float] = (5.0, 8.0)
    own: int = 4  # unknowns beside those of the curve: ln σ/σ₀ (2,), δ₀ and b over their spreads
    # curves
    tiny: float = 1e-9  # rad: keeps Dugoff's λ finite at zero slip, where it does not matter
    longest: float = 10.0  # wheelbases, of a relaxation length
    # lagged_ekf
    stiffness: float = 14.0  # at first, in static axle loads/rad
    friction: float = 0.85  # at first, in static axle loads
    states: int = 10  # of the filter
    no_gate: float = 1e6  # standard deviations
    # ports
    most_felt: float = 98.0  # m/s²: no car feels more
    shortest: float = 1e-9  # m: keeps v_x T_s/σ finite without a lag, where e^(-v_x T_s/σ) is zero


CHOSEN = Chosen()
