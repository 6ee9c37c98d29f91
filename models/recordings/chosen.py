"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # assembly
    fastest: float = 5e-4  # [s]: shortest step by which a unit of the time is guessed
    # [s]: a segment of less teaches nothing, since learning waits half a second
    shortest: float = 1.0
    # Hz: nothing of a drive passes, and the filter's numbers are still right
    least_low_pass: float = 0.01
    # checks
    # [rad], 69 degrees: beyond every road wheel and scale car (about 50)
    largest_steering: float = 1.2
    largest_speed: float = 110.0  # [m/s], 396 km/h; a sedan's 110 km/h reads 110
    largest_v_x_r: float = 60.0  # [m/s^2], 6 g: beyond downforce cars; 1 m/s^2 in degrees reads 57
    sure_pair: float = 0.9  # correlation from which two channels are of one bend
    no_pair: float = 0.3  # correlation up to which they are of none
    # slope of a_y on v_x r, below zero, up to which it is not turned but lacks v_x r
    lacks: float = 0.35
    # a_y on v_x r is 1, with roll up to 1.2; km/h 0.28, g 0.10, degrees 0.017
    slope: tuple[float, float] = (0.5, 2.0)
    # [m], in judging a mass: so 64 kg at least, a kart with driver has 150
    longest_wheelbase: float = 4.0
    # [kg/m^3]: mass over wheelbase cubed is 17 to 300 for all cars; in kN 0.3 at most
    lightest: float = 1.0
    # [rad], 40 degrees in the median window: nobody drives a whole run like that
    largest_slip: float = 0.7
    # evidence
    # [s]: keeps maneuvers up to 2 Hz, averages 20 samples of noise at 100 Hz
    evidence_window: float = 0.2
    # [s], longer where a recording is: evenly over it, as many as of `codegen.arrays.LONG` samples
    stride: float = 0.05
    slowest: float = 0.5  # [m/s]: below it slip and curvature are noise, for scale cars too
    turns: float = 0.2  # of what a channel reaches, beyond which the car turns
    evidence_alike: float = 0.7  # least correlation of a sign
    beyond_chance: float = 16.0  # least square of its t, of a sign
    least: float = 0.1  # [m/s^2], rms, below which nothing turns
    longest: float = 8.0  # [m], wheelbase by which steering says how much it turns at least
    # [rad]: sideslip against the turn beyond which a driver may countersteer
    tail_out: float = 0.15
    # portion
    segment: float = 20.0  # s of one, where a quarter of the samples are enough for that
    steps: int = 4  # beginnings that a segment may have in the time of one
    fewest_segments: int = 4  # segments, so that there are some on both sides of a middle
    # s that the car stands at the end of a segment: a delay of that leaves the next alone
    rest: float = 0.6
    # pose
    no_slip: float = 2e-3  # v_y over v_x of a pose that is integrated along its heading
    pose_slow: float = 0.025  # [s] between poses from which a gyro tells the yaw rate
    fewest_samples: int = 30  # samples of a piece that is differentiated
    stands: float = 0.05  # [m/s], a pose that never goes faster does not move
    # share of the largest speed below which the direction of travel is not asked
    moves: float = 0.2
    # [rad] that the direction of travel may lie off the heading, or a quarter of a turn
    along: float = 0.35
    # length of the mean direction of travel against the heading, 1 where all agree
    along_all: float = 0.9
    latest: float = 0.3  # [s] that a gyro may be late against a pose
    late: float = 0.01  # [s] that it is late, more of which is taken out of it
    pose_alike: float = 0.9  # correlation of the two yaw rates from which that is known
    # record
    minimum_samples: int = 10  # of a segment: fewer are no recording
    pause: float = 1.0  # [s] between logs that are joined and whose clocks overlap
    # largest departure of a sample from the uniform grid, as a share of one step
    jitter: float = 0.02
    # share of a step within which time stamps are those of the grid, with jitter
    on_grid: float = 0.01
    same: float = 1e-6  # share of a step within which they already are the grid, but for rounding
    # rolled
    slip: float = 0.03  # share of the speed; more, and `noise`, is no usual slip
    noise: float = 0.05  # [m/s]
    # share of the speed: wheels that differ by less, and `noise`, have no slip that tells them
    # apart
    rolled_alike: float = 0.01
    rolled_window: float = 0.05  # [s], over which the acceleration of a wheel is taken
    memory: float = 0.15  # [s], over which that of the car is
    braked: float = -1.0  # [m/s²]: wheels are braked below
    rolls_out: float = -0.3  # [m/s²]: wheels are driven above
    # of the largest acceleration: how far it may have changed while nothing is trusted
    unsure: float = 0.25
    patience: float = 2.0  # [s]: after it wheels that all agree again are believed the sooner
    rolled_slow: float = 1.0  # [m/s]: below it sensors of wheels show nothing
    # wheels
    radii: tuple[float, float] = (0.01, 2.0)  # of a wheel [m], of model cars to dump trucks
    lengths: tuple[float, float] = (0.05, 20.0)  # of a track and a wheelbase [m]
    accelerations: tuple[float, float] = (0.5, 100.0)  # [m/s²]
    straight: float = 0.05  # [rad/s], largest yaw rate
    even: float = 0.5  # [m/s²], largest acceleration
    fast: float = 0.3  # of the speed that 5 % of the samples exceed: slower ones do not count
    long_enough: float = 2.0  # [s] of such driving, at least
    agrees: float = 0.02  # of the median: farther off, a wheel slips
    # between quartiles, as a share of the median, beyond which nothing is learnt
    spread: float = 0.05
    # speed over ground per speed of a wheel, of one that shows a speed
    speeds: tuple[float, float] = (0.8, 1.25)
    most: int = 200_000  # samples that are looked at


CHOSEN = Chosen()
