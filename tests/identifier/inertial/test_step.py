"""The compiled step against a textbook filter: dense covariance, Jacobians by differences."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.axle.car import Car, car_numbers
from identifier.axle.covariance import unpacked
from identifier.axle.curve import curve, doublings
from identifier.inertial import InertialIdentifier
from identifier.inertial.motion import (
    MOVING,
    SENSORS,
    Laws,
    Sample,
    _size,
    expected_signals,
    predicted,
    unknowns,
)
from identifier.run import identify
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan

G, CAR, DT = 9.81, sedan(), 0.01
METHOD = replace(InertialIdentifier.for_vehicle(CAR), sensor_position=(0.3, -0.1))
N = len(METHOD.ladder)
Q = _size(N)
LOAD = CAR.weight * np.array([CAR.l_r, CAR.l_f]) / CAR.wheelbase


def compiled_model():
    """Motion and sensors as functions of numbers; they have tests of their own."""
    steps = doublings(METHOD.ladder)
    scales = ca.SX(ca.DM(1 / np.array(METHOD.ladder)[None]))
    car = Car(*ca.horzsplit(ca.SX(ca.DM(car_numbers(CAR)))))
    omega, t = METHOD.roll_frequency * np.sqrt(G / CAR.wheelbase), METHOD.trust
    laws = Laws(
        forgets=np.exp(-DT / t.correlation_time),
        bank=np.exp(-DT / t.bank_time),
        roll_stiffness=omega**2,
        roll_damping=2 * METHOD.roll_damping * omega,
        sway=METHOD.prior.sway_share / omega**2,
        ahead=0.3,
        aside=-0.1,
        late=METHOD.a_y_late,
        steering_gain=0.0,
    )
    z, tilt = ca.SX.sym("z", Q), ca.SX.sym("tilt", 2)
    old, new = ca.SX.sym("old", 3), ca.SX.sym("new", 3)
    before, now = Sample(old[0], old[1:]), Sample(new[0], new[1:])
    a = predicted(car, laws, DT, unknowns(z, N), (tilt[0], tilt[1]), before, now, scales, steps)
    moved = ca.vertcat(a.moving, z[MOVING:])
    step = ca.Function(
        "step",
        [z, tilt, old, new],
        [moved, ca.vertcat(a.tilt, a.tilt_rate), a.curve.force, a.force_rate],
    )
    way, moving = a.by_way
    gradient = ca.Function("gradient", [z, tilt, old, new], [way.gradient(z, moving)])
    at = curve(unknowns(z, N).slip, unknowns(z, N).W, scales, steps)
    seen = expected_signals(car, laws, unknowns(z, N), tilt[0], now, at)
    look = ca.Function("look", [z, tilt, new], [ca.vertcat(seen.r, seen.a_y), at.force])

    def numbers(f):
        """f of vectors; one of them may be a matrix, whose columns f takes one by one."""

        def called(*given):
            found = [np.array(one) for one in f.call([ca.DM(x) for x in given])]
            return [one if one.shape[1] > 1 else one.ravel() for one in found]

        return called

    return numbers(step), numbers(look), lambda *given: np.array(gradient(*map(ca.DM, given)))


def composed(by_way):
    """F of what moves, from rows that go on from rows before them."""
    on_the_way, rows = by_way.shape[1] - Q, []
    for row in by_way:
        before = row[Q : Q + len(rows)] @ np.array(rows[:on_the_way]).reshape(-1, Q)[: len(rows)]
        rows.append(row[:Q] + before)
    return np.vstack([rows[on_the_way:], np.eye(Q)[MOVING:]])


def by_differences(f, z):
    h = 1e-6 * np.eye(z.size)
    ahead, behind = np.hsplit(f(np.hstack([z[:, None] + h, z[:, None] - h])), 2)
    return (ahead - behind) / 2e-6


def learnt(held):
    """Directions of z beside what moves, by columns, and the covariance of steps along them."""
    grip_f, grip_r, stiff_f, stiff_r = METHOD.setup(CAR).constants["curves"]
    _, own = METHOD.prior.means(CAR, METHOD.ladder)
    nothing, first = np.zeros(N), MOVING + 2 * N + 2

    def sensor(name):
        return np.eye(Q)[first + SENSORS.index(name), MOVING:]

    def tires(front, rear, own):
        return np.concatenate([front, rear, own, np.zeros(len(SENSORS))])

    rows = [tires(grip_f, nothing, [0, 0]), tires(nothing, grip_r, [0, 0])]
    rows += [tires(stiff_f, nothing, [0, 0]), tires(nothing, stiff_r, [0, 0])]
    rows += [tires(nothing, nothing, own[:, 0]), sensor("steering")]
    P = np.zeros((6, 6))
    for i, one in enumerate(METHOD.prior.covariance(CAR, METHOD.ladder)):
        back = np.linalg.pinv(
            np.stack([rows[i][N * i : N * i + N], rows[2 + i][N * i : N * i + N]]).T
        )
        P[i:4:2, i:4:2] = back @ one[:N, :N] @ back.T
    b = METHOD.beliefs
    P[4, 4], P[5, 5] = (METHOD.prior.sd_compliance / own[0, 0]) ** 2, b.steering**2
    if held:
        rows, P = [rows[0] + rows[1]], np.array([[b.grip**2]])
    sensors = {"bias": b.bias, "roll": b.sd_roll, "gyro": b.gyro / np.sqrt(CAR.wheelbase / 2.7)}
    beside = np.diag(np.square(list(sensors.values())))
    P = np.block([[P, np.zeros((len(P), len(beside)))], [np.zeros((len(beside), len(P))), beside]])
    return np.array([*rows, *(sensor(name) for name in sensors)]).T, P


class ByHand:
    """The filter with plain matrices."""

    def __init__(self, held=False):
        self.step, self.look, self.gradient = compiled_model()
        W, own = METHOD.prior.means(CAR, METHOD.ladder)
        self.z = np.concatenate([np.zeros(MOVING), *W, own[:, 0], np.zeros(4)])
        self.z[-3] = METHOD.beliefs.roll
        scale = np.sqrt(CAR.wheelbase / 2.7)
        along, P = learnt(held)
        q = MOVING + len(P)
        self.P, self.into = np.zeros((q, q)), np.zeros((Q, q))
        self.P[MOVING:, MOVING:] = P
        (
            self.into[:MOVING, :MOVING],
            self.into[MOVING:, MOVING:],
        ) = np.eye(MOVING), along
        self.scale, self.running, self.fast = scale, False, 0.0
        self.noise = np.array([METHOD.trust.r_noise / scale, METHOD.trust.a_y_noise]) ** 2
        self.waiting, self.left, self.turns = np.zeros(2), np.zeros(2), [0, 0]

    def begin(self, sample, r, a_y):
        """Start in a steady corner, on a linear tire."""
        t, v_x, delta = METHOD.trust, sample[0], sample[1:]
        C = (self.z[MOVING + N : MOVING + 2 * N] / np.array(METHOD.ladder)).sum()
        lean = np.sign(r) * min(abs(v_x * r) / G, 1) / C
        v_y = v_x * (delta[1] - lean) + CAR.l_r * r
        arm = np.array([CAR.l_f, -CAR.l_r])
        self.z[:MOVING] = [
            v_y,
            r,
            *(delta - np.arctan((v_y + arm * r) / v_x)),
            0,
            0,
            0,
        ]
        unsure = (t.v_y * np.sqrt(G * CAR.wheelbase)) ** 2 + (0.7 * v_x * lean) ** 2
        self.P[:MOVING], self.P[:, :MOVING] = 0, 0
        sd = [t.r / self.scale, *[np.sqrt(unsure) / v_x] * 2, t.error, t.error]
        sd += [t.bank]
        self.P[range(MOVING), range(MOVING)] = [
            unsure,
            *np.array(sd) ** 2,
        ]
        self.tilt = np.array([v_x * r, 0.0])
        self.readings = [np.array([r, a_y])] * 2

    def go_on(self, before, sample, y):
        t, z = METHOD.trust, self.z
        exact = by_differences(lambda z: self.step(z, self.tilt, before, sample)[0], z)
        F = composed(self.gradient(z, self.tilt, before, sample))
        exact, F = exact @ self.into, F @ self.into
        moves = np.sqrt(np.diag(self.P))  # what the gradient leaves out is of second order
        off = np.abs((F - exact)[:MOVING] * moves).max(axis=1)
        assert (off < 0.03 * np.sqrt(moves[:MOVING] ** 2 + 1e-8)).all()
        ahead, tilt, force, rate = self.step(z, self.tilt, before, sample)
        missed = t.error + t.relative_error * np.abs(force)
        F = np.vstack([F[:MOVING], np.eye(len(self.P))[MOVING:]])
        noise = np.zeros(len(self.P))
        natural = np.sqrt(CAR.wheelbase / G)
        noise[1] = (t.jerk / natural**1.5) ** 2 * DT
        noise[4:6] = missed**2 * (1 - np.exp(-2 * DT / t.correlation_time))
        noise[6] = 2 * t.bank**2 * DT / t.bank_time
        P = F @ self.P @ F.T + np.diag(noise)
        now, old = self.readings
        news = np.abs(y - now) > 0.1 * np.abs(now - old)  # a number that settles is none
        shows = np.minimum((y - 2 * now + old) ** 2 / 6, 9 * self.noise + 1e-12)
        self.noise = self.noise + news * (shows - self.noise) / t.noise_samples
        self.readings = [np.where(news, y, now), np.where(news, now, old)]
        self.waiting = np.minimum(self.waiting + news, 4)
        H = by_differences(lambda z: self.look(z, tilt, sample)[0], ahead) @ self.into
        expected, static = self.look(ahead, tilt, sample)
        turn = np.array([CAR.l_f, -CAR.l_r]) * LOAD / CAR.yaw_inertia @ static
        late = np.array([turn, G * LOAD / CAR.weight @ rate])
        floor = np.array([(t.r_error / self.scale) ** 2, t.a_y_error**2])
        floor[1] += (t.a_y_share * tilt[0]) ** 2
        R = (floor + (t.lateness * late) ** 2) / np.maximum(self.waiting, 1) + self.noise
        i = 0 if self.waiting[0] >= self.waiting[1] else 1  # its turn
        nus = np.where(news, y - expected, self.left)
        h, R, known = H[i], R[i], [nus[i]] if self.waiting[i] else []
        moved = np.zeros(len(P))
        if known:
            self.turns[i] += 1
            S = h @ P @ h + R
            nu = np.clip(np.mean(known), -t.clip * np.sqrt(S), t.clip * np.sqrt(S))
            K = P @ h / S
            moved, P = K * nu, P - np.outer(K, h @ P)
        self.left, z = nus - H @ moved, ahead + self.into @ moved
        self.waiting[i] = self.left[i] = 0
        q = np.minimum((z[4:6] / missed) ** 2, 25).mean()
        self.fast += DT / t.alarm_time * (q - self.fast)
        assert self.fast < t.alarm  # else the covariance would be opened, which this leaves out
        self.z, self.P, self.tilt = z, P, tilt

    def take(self, before, sample, r, a_y):
        if self.running:
            self.go_on(before, sample, np.array([r, a_y]))
        else:
            self.begin(sample, r, a_y)
        self.running = True
        return self.z[0], np.sqrt(self.P[0, 0])


@pytest.fixture(scope="module", params=[True, False], ids=["held", "learnt"])
def runs(request):
    """Tires held, and learnt."""
    held = request.param
    maneuver = Slalom(
        amplitude=np.radians(3.0), frequency=0.6, onset=0.5, rate_limit=1.0, duration=3.99
    )
    recording = Plant(CAR).simulate(maneuver, speed=20.0).recording()
    rng = np.random.default_rng(2)
    kept = 3 * (np.arange(len(recording)) // 3)
    kept[: len(kept) // 2] = np.arange(len(kept) // 2)  # then its sensors are slower than the log
    noisy = replace(
        recording,
        r=(recording.r + 0.003 * rng.normal(size=len(recording)))[kept],
        a_y=(recording.a_y + 0.1 * rng.normal(size=len(recording)))[kept],
    )
    method, hand, told, before = replace(METHOD, held=held), ByHand(held), [], None
    for k in range(len(noisy)):
        sample = np.array([noisy.v_x[k], noisy.delta_f[k], noisy.delta_r[k]])
        told.append(hand.take(before, sample, noisy.r[k], noisy.a_y[k]))
        before = sample
    return np.array(told), hand, identify(noisy, CAR, method)


@pytest.mark.sweep("held")
def test_lateral_velocity_and_its_deviation_are_those_of_the_textbook(runs):
    told, hand, history = runs
    assert min(hand.turns) > 40
    assert np.abs(told[:, 0]).max() > 0.1
    np.testing.assert_allclose(history.outputs["v_y"].ravel(), told[:, 0], atol=2e-6)
    np.testing.assert_allclose(history.outputs["v_y_sd"].ravel(), told[:, 1], rtol=2e-4)


@pytest.mark.sweep("held")
def test_what_is_learnt_is_that_of_the_textbook(runs):
    _, hand, history = runs
    last = {name: np.asarray(value[-1]).ravel() for name, value in history.state.items()}
    learnt = np.concatenate([last[name] for name in ("motion", "W", "own", "sensors")])
    np.testing.assert_allclose(learnt, hand.z, rtol=1e-4, atol=1e-6)
    assert np.abs(hand.z[MOVING:] - ByHand().z[MOVING:]).max() > 0.02  # something was
    (P,) = unpacked(last["UD"][None], len(hand.P) - MOVING)
    np.testing.assert_allclose(P, hand.P[MOVING:, MOVING:], rtol=2e-3, atol=1e-7)
