"""Numbers that were chosen here, file by file, with their units and reasons."""

import math
from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # accelerometer
    filtered: float = 0.25  # [s] of means
    stride: float = 0.1  # [s] between means
    error: float = 0.02  # of g, an error of the accelerometer
    relative: float = 0.03  # of the acceleration, an error of the accelerometer
    least_scale: float = 0.3  # of the scale of what is missed
    least_memory: float = 0.25  # [s]
    # consistency
    fewest_windows: int = 20  # windows: fewer say nothing
    most_windows: int = 500  # windows: of more that many are taken all over the log
    # Ratio of a curve to the next. Curves that are tried lie on one grid of c and μ, so that many
    # have the same c/μ: to saturate them, which costs most, is done once for each of these.
    fineness: float = 100.0 ** (1.0 / 27.0)
    stiffnesses: int = 28  # c of that grid
    frictions: int = 15  # μ of that grid
    # per square of the logarithm of c over the declared one: a stiffness that is twice that costs
    # as much as 14 % of what is left unexplained
    disbelief: float = 0.3
    # sqrt(g L), 30 m/s for a sedan; what is faster costs as much per square of a logarithm
    fast: float = 6.0
    # share of the variance of φ, below which less that is left says nothing more
    exact: float = 0.003
    clear: float = 2.5  # times its noise that a channel must swing for its unit to be identified
    # slope of a_y on dv_y/dt + v_x r, with the roll of the body
    rolling: tuple[float, float] = (0.85, 1.25)
    # diagnosis
    rounds: int = 2  # in which the ratio of a steering wheel is found
    settled: float = 0.02  # change of that ratio, in parts, below which it is settled
    wide: float = 1.0  # of that ratio, by which the screen may be off
    surely: float = 0.9  # confidence that a law is broken
    # finding
    most_confidence: float = 0.99  # confidence that is given
    matters: float = 0.5  # confidence that something is wrong, from which it is given as such
    # pieces
    window: float = 0.2  # [s]
    slowest: float = 0.3  # of the 95th percentile of speed, below which a window does not count
    piece: float = 60.0  # s of a piece that is looked at, of a drive of hours
    pieces: int = 10  # of such a drive that are looked at
    shortest_piece: int = 200  # samples of such a piece
    shortest_segment: float = 2.0  # s, below which a segment between two gaps is not looked at
    # readings
    # that a change must earn: less than it is left by a third in a sum of logarithms
    gain: float = 1.1
    freedom: float = 0.5  # that a change must earn beside, whose factor is free
    # left of each equation, above which more changes are tried together
    deeper: float = math.log(0.15)
    kept: int = 8  # readings that are taken further
    judged: int = 10  # of the best, by laws that need no vehicle
    most_changes: int = 4  # changes at once
    # of ln of a steering factor, within which nothing is gross
    same_steering: float = math.log(2.5)
    same_size: float = math.log(2.2)  # of ln of the size of a car, within which nothing is gross
    same_inertia: float = math.log(2.0)  # of ln of its yaw inertia, within which nothing is gross
    finer: int = 5  # golden sections, of an arm
    finest: int = 12  # golden sections, of a steering angle
    alike_factors: float = math.log(1.15)  # factors that say the same
    as_good: float = 0.5  # of cost: by so much a wrong sign may be worse than one with a factor
    steepness: float = 3.0  # of the confidence over what the next best reading leaves more
    alone: float = 2.8  # price of a v_y in another unit than v_x
    unusual: float = 2.0  # price of a v_y that is an angle in deg
    # samples
    freeze: float = 0.3  # [s] that a noisy channel repeats one number
    moves: float = 0.15  # of the range of v_x r, by which a car must move meanwhile, in any unit
    repeated: float = 0.01  # of a noisy channel: share of repeated samples
    few: int = 5  # of a noisy channel: how often it repeats
    caught_up: float = 0.025  # of a rounded channel: share of samples after which it catches up
    alike_delays: float = math.log(1.6)  # of the times by which samples of two channels are late
    coarse: float = 0.05  # quantum over the rms of a channel
    certain: float = 0.99  # confidence in what samples show by themselves
    # screen
    # [m/s^2] of v_x r, which a drive must exceed in a share `lively` of its windows
    quiet: float = 0.8
    lively: float = 0.005  # share of the windows of a drive, as of `quiet`
    # confidence above which nothing else is named beside, and what is found is mended
    sure: float = 0.95
    several: int = 3  # changes at once, beyond which nothing is sure
    wheel: tuple[float, float] = (5.0, 30.0)  # ratios of a steering wheel to the road wheels
    near: float = math.log(1.15)  # of a factor to that of a unit
    # of a drive, from which a channel that does not change is no measurement
    perfect: float = 0.999
    # of a drive, from which a channel that reads exactly 0 so long is no measurement
    often: float = 0.1
    slow: float = 1.0  # s between samples, from which a clock is in ms
    # suspects
    sedan: float = 2.7  # m, wheelbase of whose size the numbers are
    degrees: float = math.degrees(1.0)  # in a rad
    # of I_z/(m l_f l_r); cars on the road have 0.9 to 1.1
    inertia: tuple[float, float] = (0.5, 1.6)
    small: float = 1.0  # [m] wheelbase, below which a model car may have as little
    small_inertia: float = 0.3  # of I_z/(m l_f l_r), the least of such a model car
    # wheelbases that a car, and what is mounted to it, reach beyond its axles
    overhang: float = 0.5
    # l_f over the wheelbase: a load that an axle of a car can have
    center: tuple[float, float] = (0.25, 0.75)


CHOSEN = Chosen()
