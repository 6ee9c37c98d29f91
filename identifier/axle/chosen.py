"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # band
    # rad: ends of the ranges of slip, the last is open
    ranges: tuple[float, ...] = (0.01, 0.02, 0.04, 0.08, 0.16)
    # rad: where the factor of a range holds
    centers: tuple[float, ...] = (0.005, 0.015, 0.03, 0.06, 0.12, 0.24)
    # sqrt(g L): ends of the ranges of speed, first and last are open
    speeds: tuple[float, float, float] = (2.0, 3.0, 4.0)
    # sqrt(g L): where the factor of a range of speed holds
    at_speeds: tuple[float, ...] = (1.5, 2.5, 3.5, 4.5)
    stretch: tuple[float, float] = (0.5, 2.0)  # least and most of s
    least_factor: float = 0.1  # of the factors of a band, over errors as they are declared [-]
    most_factor: float = 100.0  # of the same factors, and of the noise [-]
    # of the factor for errors that last longer than they are declared to [-]
    most_color: float = 1000.0
    unknown: float = 0.25  # standard deviation over the prior's, from which on slip is not known
    # certificate
    largest_slip: float = 1.5  # rad
    cells: int = 2000  # of slip, each a part wider than the one before
    smallest_cell: float = 1e-5  # rad, from zero slip
    on_bound: float = 1e-9  # of a bound, within which a corner lies on it
    longest: float = 60.0  # s, beyond which a drop is not followed
    # share of its own information that a sample may forget: good, bad
    forgets: tuple[float, float] = (0.5, 0.9)
    # covariance
    # of stored weights: of a parameter given those after it, in its unit
    least_variance: float = 1e-14
    covariance_tiny: float = 1e-30  # keeps quotients of factors finite where one has vanished
    # share of the limit that rounding in float may take in a step
    covariance_rounding: float = 1e-5
    # learning
    largest_q: float = 25.0  # of one outlier
    slow_q: float = 4.0  # the slow mean does not follow a change
    # squared errors: above twice the declared they are no noise to get used to
    most_slow: float = 4.0
    learning_tiny: float = 1e-12  # of a size that is divided by
    # of a step that is limited: towards the center, by more than rounding can do
    lean: float = 1e-4
    # model
    largest: float = 1e9  # of the numbers in a file, SI and static axle loads
    largest_weight: float = 100.0  # static axle loads: no unit of a tire carries more
    model_rounding: float = 1e-6  # of correlations, as learning in float leaves them
    # standard deviation over the prior's, up to which a drive decided a number
    decided: float = 0.5
    draws: int = 1000  # of weights, before a possible tire must have been among them
    bent: float = 0.4  # slope over that at zero, below which a curve shows where it saturates
    # prior
    ridge: float = 0.3  # keeps projected weights small where units are alike
    step: float = 1.2  # ratio over which log-derivatives are taken
    # slip
    slowest: float = 0.1  # rad/s, of a body that rolls on springs
    fastest: float = 100.0  # rad/s, of a body that rolls on springs
    # per wheelbase: ∂x/∂s stays below it, also where its recursion does not settle
    most_sensitive: float = 1e4
    # g: ρ and ρ'/ω stay below it, at any sampling and however speed changes
    most_sway: float = 10.0


CHOSEN = Chosen()
