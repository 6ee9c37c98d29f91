"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # drive
    fastest: float = 0.01  # [s]: sampled faster, samples are averaged
    smoothed: float = 0.07  # [s] of a mean, of a sedan
    slow: float = 0.45  # sqrt(g L): below, no tire curve is learnt
    longitudinal: float = 0.3  # [s] over which v_x is differentiated
    most_a_x: float = 18.0  # m/s²
    bank_mean: float = 1.0  # [s]: roads bank slowly
    # sine, by which an accelerometer may be off level; twice that is a bank in full
    level: float = 0.01
    most_roll: float = 0.08  # per g, by which a body rolls outwards
    late: tuple[int, int, int] = (1, 2, 3)  # columns of v_y, r and δ_f
    # of the fast motion that an accelerometer may miss, else it is none of this car
    explained: float = 0.15
    # slope of an accelerometer's a_y on that motion; a body rolls
    across: tuple[float, float] = (0.8, 1.2)
    along: tuple[float, float] = (0.8, 1.25)  # slope of its a_x on that motion; a body pitches
    # fit
    fit_block: float = 600.0  # [s] that are estimated at once
    blind: float = 300.0  # [s] of a log without v_y that teach: those of hardest cornering
    enough_more: float = 1.0  # [nats] of improvement by a later block, below which it ends
    long: float = 3600.0  # [s]: samples of longer logs are averaged
    coarse: float = 2.0  # times the usual interval, to which they are averaged
    reached: float = 0.25  # [s] for which a slip must have been exceeded to count as driven
    # [s] after which noise of a sedan's sensors is over, errors of its model are not
    lasts: float = 0.15
    # information
    # [rad]
    grid: tuple[float, ...] = (0.004, 0.008, 0.015, 0.025, 0.04, 0.06, 0.09, 0.13, 0.19, 0.28)
    information_least_reach: float = 0.01  # [rad], up to which the curve is always asked
    information_beyond: float = 0.02  # weight of a slip that no drive reached
    ridge: float = 1e-6  # of the least squares, in prior variances of the curve's numbers
    # latent
    latent_roll: float = 0.06  # by which a_y is larger in a car whose body rolls
    gyro: float = 0.002  # sd of the bias of r of a sedan [rad/s]
    inertia: float = 0.007  # sd of ln I_z
    latent_block: float = 600.0  # [s] that are smoothed at once
    beside: float = 5.0  # [s] beside them that are smoothed, too
    latent_asked: float = 60.0  # [s] that are asked for a late a_y
    any_delay: float = 0.1  # [s] of a sedan, sd of a delay that is looked for
    most_late: float = 0.3  # [s] of a sedan, the largest delay
    small_delay: float = 0.003  # [s] of a sedan, a delay that does not matter
    looks: int = 4  # at a delay
    left_late: float = 0.01  # [s] of a sedan, sd of what is left of a delay that was taken out
    gained: float = 8.0  # nats that a delay gains, more where more is left (`Trust.usual`)
    alike: float = 1e-4  # probability from which another start's end counts
    starts: tuple[float, float] = (-0.4, 0.4)  # of ln C: soft and stiff
    firm: float = 50.0  # times that beliefs count at first
    few: int = 8  # iterations of all descents but the last
    most_slip: float = 0.7  # |v_y/v_x|, at most
    most_lagged: float = 0.8  # lagged slip [rad], at most
    looked: float = 0.25  # [s] over which what is left of a sensor is alike
    shortest: int = 50  # nodes from which noise is learnt
    # model
    widest: float = 0.6  # rad, within which the largest force is looked for
    decided: float = 0.5  # standard deviation over the prior's, up to which drives decided a number
    # times what the drives that taught miss, on others; chosen on recordings of three real cars and
    # two simulated ones, since the errors of a plant that one draws are those that one thought of
    elsewhere: float = 2.25
    sure_mass: float = 0.03  # sd of a given mass, of it
    sure_center: float = 0.01  # sd of a given center of gravity [wheelbases]
    typical: float = 0.5  # static loads, at which an error is given as a share of the force
    slope_step: float = 1e-4  # rad, over which a slope is taken
    surely: float = 3.0  # standard deviations of an error of the steering that is noted
    noted_gain: float = 0.08  # least error of the steering that is noted [-]
    warm: int = 300  # samples before a part of a long drive, over which lag and sway settle
    least_doubt: float = 1e-6  # of a prior, in variances of the usual one
    largest: float = 1e6  # of the numbers in a file
    # nodes
    between: float = 0.06  # sqrt(L/g) from a node to the next
    least_between: float = 0.02  # [s] that it is at least
    rolls: float = 5.0  # Hz of a sedan, below which a_y rolls the body
    jerks: float = 3.0  # Hz of a sedan, below which a_y is differentiated
    fewest_nodes: int = 3  # nodes of a segment
    # poor
    rare: float = 0.03  # [s] of a sedan between new values, more of which are too few
    # [m/s] of a sedan, white noise that is too much in the mean that the estimate takes
    noisy: float = 0.015
    fewest_values: int = 20  # new values
    fine: float = 0.005  # [s] of a sedan, to which a delay is found
    sure: float = 20.0  # nats that a delay must gain
    poor_asked: float = 60.0  # [s] of hardest cornering that tell delay and noise
    most: int = 12000  # samples of hardest cornering that tell them
    # ρ, mean of its prior: by which a_y is larger in a car whose body rolls
    poor_roll: float = 0.05
    roll_sd: float = 0.04  # of ρ, standard deviation of its prior
    off: float = 0.15  # [m/s²], b at first
    wanders: float = 5e-3  # [(m/s²)²/s], variance of b' of a banked road
    equal: float = 1e-9  # of the largest change, below which two are one
    clip: float = 3.0  # deviations from which a sample counts less
    again: int = 3  # times that samples are weighted anew
    delay_halvings: int = 5  # halvings of the step in which a delay is looked for
    # priors
    less_load: float = 0.6  # of the geometric load transfer: tires gain less force than load
    less_use: float = 0.65  # of the geometric use of the ellipse, measured on cars and the plant
    sure_height: float = 0.03  # sd of the load transfer of a car that tells its height
    sure_share: float = 0.5  # sd of the use of the ellipse of a given share, of that use
    least_use: float = 0.1  # least sd of that use
    # At one speed a bias of v_y and a mounting angle are one: each takes half, unless speeds
    # differ.
    shared_error: float = 0.5
    # sd of ln of a yaw inertia that nobody measured: m l_f l_r is within a tenth of those of cars;
    # chosen on 16 random cars whose inertia was left out
    left_out: float = 0.1
    left_out_small: float = 0.3  # the same of a model car
    another_road: float = 0.5  # standard deviation of ln of its friction over that of the first
    tails: float = 1.0  # degrees of freedom of their priors
    # roads
    price: float = 12.0  # [nats] of a change of friction
    bin: int = 10  # residuals, half a second, on one road
    least_change: float = 0.1  # |ln m|, below which segments are one road
    most_scale: float = 1.5  # S [-] of residuals, in search of segments
    most_memory: float = 4.0  # T [s] of residuals, in search of segments
    roads_rounds: int = 2  # of finding segments anew at the better estimate
    # solve
    stride: float = 0.05  # [s] between residuals
    # b: of a static load, and of the lateral acceleration in g
    error_size: tuple[float, float] = 0.02, 0.04
    nu: float = 4.0  # degrees of freedom of the loss: a tenth of the residuals may be far off
    least_scale: float = 0.25  # S: a model is never believed to be better than that
    shortest_memory: float = 0.25  # least T [s]
    longest_memory: float = 8.0  # largest T [s]
    least_stiff: float = 0.25  # of C: slope at zero
    stiff_sd: float = 0.1  # of C: how firmly that slope is believed
    iterations: int = 25  # of a descent, at most
    enough: float = 0.02  # [nats] of improvement, below which it ends
    settling: int = 60  # iterations at most where no drive is looked at
    settled: float = 1e-4  # [nats] of improvement, below which these end


CHOSEN = Chosen()
