"""The compiled step against its equations, written out with numpy alone, sample by sample."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.faults import Bank
from identifier.axle import AxleIdentifier
from identifier.axle.covariance import unpacked
from identifier.axle.model import AxleModel
from identifier.axle.slip import Sensors
from identifier.run import identify

G = 9.81


class ByHand:
    """One axle identifier with plain matrices: no ports, no triangles, tanh and cos as they are."""

    def __init__(self, design, car, sensors):
        self.d, self.car = design, car
        self.alpha_j = np.array(design.ladder)
        n = self.n = self.alpha_j.size
        self.L, self.U = car.wheelbase, np.sqrt(G * car.wheelbase)
        self.load = car.weight * np.array([car.l_r, car.l_f]) / self.L
        self.area = np.array([car.downforce_area_front, car.downforce_area_rear])
        W, own = design.prior.means(car, design.ladder)
        self.theta = np.hstack([W, own])
        self.P = design.prior.covariance(car, design.ladder)
        widest = design.regression.widest * (1 - 1e-5)  # less what rounding in float may take
        self.most = np.array([widest * self.sizes(P) for P in self.P])
        for P, most in zip(self.P, self.most, strict=True):
            P /= max(1.0, (self.sizes(P) / most).max())
        # dw/d ln mu by differences of a projected, stretched curve instead of a derivative
        slip = np.linspace(0.002, 0.6, 300)
        T = np.tanh(slip[:, None] / self.alpha_j)
        stretched = [mu * np.tanh(slip[:, None] / mu / self.alpha_j) for mu in (1 + 1e-5, 1 - 1e-5)]
        slopes = (stretched[0] - stretched[1]) / 2e-5
        self.M = np.linalg.solve(T.T @ T + 0.09 * np.eye(n), T.T @ slopes)
        self.on = False
        self.last = np.zeros(5)
        self.bad = self.stuck = 0
        self.steady = 0.0
        self.fast, self.trend, self.slow = np.zeros(2), np.ones(2), np.ones(2)
        self.peak, self.force = np.zeros(2), np.zeros(2)
        self.longest, self.time = np.zeros(2), np.zeros(2)
        self.evidence, self.ln_friction = np.zeros(3), 0.0  # A, b, E
        self.roads = []  # changes that were believed
        self.sensors = sensors  # angle and place of v_y, share of the steering
        self.gap = self.motion = self.explained = 0.0  # of the accelerometer

    def sizes(self, P):
        """Trace of the weights' block and the other variances, which are bounded."""
        return np.array([np.trace(P[: self.n, : self.n]), *np.diag(P)[self.n :]])

    def believe(self, sample):
        """The sample to go on with, or None where forces read zero; and whether to learn."""
        p, dt = self.d.plausibility, self.d.dt
        v_x, v_y, r, *delta = sample
        good = v_x < p.max_speed and abs(v_y) < p.max_sideslip * max(abs(v_x), p.slow)
        good = good and abs(r) < p.max_yaw_rate and max(map(abs, delta)) < p.max_steering
        if self.on:
            since = dt * (1 + self.bad)
            far = np.abs(sample - self.last)
            good = good and max(far[:2]) < p.max_rate * since + p.jump
            good = good and far[2] < p.max_yaw_acceleration * since + p.yaw_jump
            good = good and max(far[3:]) < p.max_steering_rate * since + p.steering_jump
        same = v_y == self.last[1] and r == self.last[2]
        self.stuck = self.stuck + 1 if same else 0
        self.bad = 0 if good else self.bad + 1
        if good:
            self.last = sample
        held = self.on and self.bad * dt <= p.hold
        restart, self.on = not self.on, bool((good or held) and self.last[0] >= p.min_speed)
        if not self.on:
            self.bad, self.steady = 0, 0.0
            return restart, False
        if restart:
            self.steady = 0.0
        calm = self.bad < 3 and self.stuck * dt <= p.hold and self.last[0] > p.learning_speed
        self.steady = self.steady + dt if calm else 0.0
        return restart, good and self.stuck < 3 and self.steady >= p.settle - 1e-9

    def road(self):
        """What the road pushes to the left, as far as it was told before this sample [loads]."""
        d, m = self.d.road, self.d.regression
        if self.explained < -(d.doubt**2) or abs(self.gap) > d.most:
            return 0.0
        beyond = self.gap - np.clip(self.gap, *np.sort([0.0, -d.roll * self.motion]))
        counted = np.interp(abs(beyond), [0, d.level, 2 * d.level, 1], [0, 0, 2 * d.level, 1])
        most = d.most if self.explained > 0 else 0.5 * m.sure * m.error
        return np.clip(np.sign(beyond) * counted, -most, most)

    def feel(self, y, a_y, first, learns):
        """Compare the accelerometer with the motion."""
        d, dt, e = self.d.road, self.d.dt, np.exp(-self.d.regression.bandwidth * self.d.dt)
        motion = (self.load * y).sum() / self.load.sum()
        there = abs(a_y) < d.largest
        felt = a_y / G if there else motion
        if first or not there:
            self.felt_low = felt
        else:
            self.felt_low = e * self.felt_low + (1 - e) * (felt + self.felt) / 2
        self.felt, gap = felt, motion - self.felt_low
        if not first:
            share = 1 - np.exp(-dt / d.time)
            self.gap += share * np.clip(gap - self.gap, -d.step, d.step)
            self.motion += share * (motion - self.motion)
        if there and learns:
            now = (d.share * (motion - self.motion)) ** 2 - (gap - self.gap) ** 2
            self.explained += (1 - np.exp(-dt / d.memory)) * (now - self.explained)

    def step(self, sample, a_y=np.nan):
        first, learns = self.believe(np.asarray(sample, dtype=float))
        if not self.on:
            return np.zeros(2)
        v_x, v_y, r, *delta = self.last
        angle, lever, gain = self.sensors
        v_y, delta[0] = v_y - angle * v_x - lever * r, (1 + gain) * delta[0]
        delta, dt, n = np.array(delta), self.d.dt, self.n
        w, (s, k, o) = self.theta[:, :n], self.theta[:, n:].T
        omega, zeta = self.d.sway.frequency, self.d.sway.damping
        if first:
            self.rho, self.rate, self.b0 = v_x * r, 0.0, 0.0
        else:
            a = (self.phi * self.load).sum() / self.car.mass
            grip = (self.C * k * self.load).sum() / (self.car.mass * v_x)
            self.rate += dt * (omega**2 * (a - self.rho) + grip * self.rate)
            self.rate /= 1 + dt * (2 * zeta * omega + grip)
            self.rho += dt * self.rate
        b = -self.rate / (omega**2 * v_x)
        arm = np.array([self.car.l_f, -self.car.l_r])
        seen = delta - np.arctan2(v_y - o[1] + arm * r, v_x) + np.array([o[0], 0.0])
        alpha = seen + k * b
        if first:
            x, p_s, p_k = alpha, np.zeros(2), np.full(2, b)
        else:
            sigma = s * self.C + 1e-3 * self.L
            z = v_x * dt / sigma
            e, da = np.exp(-z), alpha - self.alpha0
            f = (1 - e) / z
            x = e * self.x + (1 - e) * self.alpha0 + (1 - f) * da
            dx_dsigma = ((e - f) * da - z * e * (self.alpha0 - self.x)) / sigma
            p_s = e * self.p_s + dx_dsigma * (self.C + s * self.bend * self.p_s)
            p_k = e * self.p_k + (1 - e) * self.b0 + (1 - f) * (b - self.b0)
        T = np.tanh(x[:, None] / self.alpha_j)
        S = (1 - T**2) / self.alpha_j
        phi, C = (w * T).sum(1), (w * S).sum(1)
        bend = -2 * (w * T * S / self.alpha_j).sum(1)
        least = 0.02 * np.maximum((w / self.alpha_j).sum(1), 0.1)
        pressed = np.maximum(1 + 0.5 * 1.2 * self.area * v_x**2 / self.load, 0.2)
        phi, C, bend, least = (pressed * one for one in (phi, C, bend, least))
        T, slope = pressed[:, None] * T, C
        bend, C = np.where(least > C, 0.0, bend), np.maximum(C, least)
        cos = np.cos(delta)
        offset = np.array([1.0, 1 / v_x])
        g = cos[:, None] * np.column_stack([T, slope * p_s, slope * p_k, slope * offset])
        yaw = self.car.yaw_inertia * np.array([1, -1]) * r / (self.L * self.load)
        kappa = self.d.regression.bandwidth
        xi = kappa * (v_y / G + yaw)
        now = np.column_stack([g, xi - v_x * r / G])
        if first:
            self.low = now
        else:
            e = np.exp(-kappa * dt)
            self.low = e * self.low + (1 - e) * (now + self.before) / 2
        self.before, self.x, self.alpha0, self.p_s, self.p_k = now, x, alpha, p_s, p_k
        self.C, self.phi, self.bend, self.b0 = C, phi, bend, b
        y = xi - self.low[:, -1]
        road = self.road()
        self.feel(y, a_y, first, learns)
        if learns:
            force = phi * cos, C / v_x
            self.learn(y - road, np.maximum(np.abs(seen), np.abs(x)), force)
        return phi * cos * self.load

    def deviation(self, y_hat, force):
        """Of y: what the force is wrong by, and what its slip is, by being late and by noise."""
        m, (phi, per_v_y) = self.d.regression, force
        sd = m.error + m.relative_error * np.abs(y_hat) + m.noise * per_v_y
        return sd + m.lateness * m.bandwidth * np.abs(phi - y_hat)

    def learn(self, y, size, force):
        q, n, dt, c, m = self.n + 3, self.n, self.d.dt, self.d.change, self.d.regression
        whole = self.low[:, :q]
        last = self.theta[:, :n].copy()
        A, b, E = self.evidence
        precision = A + c.spread**-2
        change = spread = 0.0
        if b**2 / precision > 2 * c.evidence and b**2 > c.explains * E * A:
            most = min(c.step, m.rate * dt)
            change, spread = np.clip(b / precision, -most, most), 1 / precision
            self.roads.append(change)
        d = self.theta[:, :n] @ self.M.T
        self.theta[:, :n] += change * d + change**2 / 2 * d @ self.M.T
        y_hat = (self.theta[:, :n] * whole[:, :n]).sum(1)
        error, sd = y - y_hat, self.deviation(y_hat, force)
        self.force += min(dt / m.moment, 1.0) * (y - self.force)
        self.peak = np.maximum(np.abs(self.force), self.peak * np.exp(-dt / m.sure_time))
        holds = self.peak >= m.sure * m.error
        h = np.where(holds[:, None], whole, np.eye(q)[-1] * whole)
        reach = m.clip * sd * self.slow
        counted = np.clip(error, -reach, reach)
        metric, excited = self.P[:, :n, :n].copy(), np.zeros(2)
        for i in (0, 1):
            P, theta = self.P[i], self.theta[i]
            wider = self.sizes(P) + spread * (d[i] @ d[i]) * np.eye(1, 4)[0]
            if wider[0] > self.most[i, 0]:
                wider = self.sizes(P)
            else:
                P[:n, :n] += spread * np.outer(d[i], d[i])
            metric[i] = P[:n, :n]
            Ph = P @ h[i]
            excited[i] = h[i] @ Ph
            doubt = max(self.fast[i] / self.trend[i], 1.0) ** 2
            R = sd[i] ** 2 * self.slow[i] * doubt * m.correlation_time / dt
            lam = np.exp(-dt / m.memory)
            shrink = (1 - (1 - lam) / lam * R / excited[i]) / (R + excited[i])
            moved = np.array([Ph[:n] @ Ph[:n], *Ph[n:] ** 2])
            wide = ((wider - shrink * moved) / self.most[i]).max()
            theta += Ph * counted[i] / (R + excited[i])
            if shrink >= 0 or wide <= 1:
                P -= shrink * np.outer(Ph, Ph)
                P /= max(wide, 1.0)
        V = sd**2 * self.slow + excited
        g, weight = (whole[:, :n] * d).sum(1), holds * dt / c.correlation_time / V
        kept = 0.0 if change else np.exp(-dt / c.time)
        new = [(weight * one).sum() for one in (g * g, g * counted, counted**2)]
        self.evidence = kept * self.evidence + new
        self.ln_friction += change
        squared, told = np.minimum(error**2 / V, 25), (error / sd) ** 2
        self.fast += min(dt / c.fast, 1) * (squared - self.fast)
        self.trend += dt / c.trend * (np.maximum(squared, 1) - self.trend)
        self.slow += dt / c.slow * (np.minimum(told, 4 * self.slow) - self.slow)
        self.slow = np.clip(self.slow, 1, 4)
        self.bound(metric)
        self.limit(last)
        gain = min(1.0, dt / m.correlation_time)
        self.time += dt * holds
        self.longest += gain * holds * np.maximum(0.0, size - self.longest)

    def limit(self, last):
        """No force changes by more in a sample than the rate lets it."""
        n, most, bounds = self.n, self.d.regression.rate * self.d.dt, self.d.bounds
        for theta, old in zip(self.theta, last, strict=True):
            move = theta[:n] - old
            over = np.abs(np.cumsum(move)).max() / most
            if over > 1:
                center = 0.5 * (bounds.least_grip + bounds.most_grip) / n
                theta[:n] = old + (1 - 1e-4) / over * move + 1e-4 * (center - old)

    def bound(self, metric):
        """Grip by the least move in the metric of the covariance; boxes by clipping.

        No drive of these tests reaches the bounds of stiffness: `test_bounds` does.
        """
        bounds, n = self.d.bounds, self.n
        for theta, P, last in zip(self.theta, metric, (bounds.steering, bounds.v_y), strict=True):
            grip, P1 = theta[:n].sum(), P.sum(1)
            theta[:n] += P1 / P1.sum() * (np.clip(grip, bounds.least_grip, bounds.most_grip) - grip)
            theta[:n] = np.clip(theta[:n], -bounds.weight, bounds.weight)
            theta[n:] = np.clip(theta[n:], [0, 0, -last], [bounds.compliance, 1, last])


def disturbed(recording):
    """A recording with noise, a spike, a dropout, a stuck sensor, a standstill: every branch."""
    rng = np.random.default_rng(3)
    n = recording.t.size
    v_x, v_y = recording.v_x.copy(), recording.v_y + 0.02 * rng.standard_normal(n)
    r = recording.r + 0.002 * rng.standard_normal(n)
    v_y[300] += 4.0
    r[400:440] = 30.0
    v_y[500:512], r[500:512] = v_y[500], r[500]
    v_x[700:720] = 0.0
    v_x[730:800] = 2.0
    return replace(recording, v_x=v_x, v_y=v_y, r=r)


@pytest.mark.parametrize("damage", [False, True])
def test_step_repeats_the_equations_by_hand(damage, car, drive):
    recording = drive(n=1200, amplitude=0.08)
    recording = disturbed(recording) if damage else recording
    design = AxleIdentifier.for_vehicle(car)
    hand = assert_by_hand(design, car, recording)
    moved = np.abs(hand.theta - np.hstack(design.prior.means(car, design.ladder)))
    assert moved[:, :4].max() > 0.05


def assert_by_hand(design, car, recording, start=None):
    """Run both, compare all that is told and learnt, and return what was done by hand."""
    history = identify(recording, car, design, start)
    hand = ByHand(design, car, (0.0, 0.0, 0.0) if start is None else start.sensors)
    samples = np.column_stack([recording.v_x, recording.x, recording.u])
    felt = np.full(len(recording), np.nan) if recording.a_y is None else recording.a_y
    forces = np.array([hand.step(*sample) for sample in zip(samples, felt, strict=True)])
    largest = np.abs(forces).max()
    np.testing.assert_allclose(history.axle_force, forces, rtol=0, atol=1e-6 * largest)
    model = history.freeze(1e9)
    np.testing.assert_allclose(
        np.hstack([model.W, model.beside_curve]), hand.theta, rtol=1e-4, atol=1e-6
    )
    np.testing.assert_allclose(model.covariance, hand.P, rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(model.excitation[:, 0], hand.longest, rtol=1e-5)
    np.testing.assert_allclose(model.excitation[:, 1], hand.time, atol=0.5 * design.dt)
    last = history.state_at(1e9)
    change = [*hand.evidence, hand.ln_friction]
    np.testing.assert_allclose(last["change"].ravel(), change, rtol=1e-3, atol=1e-6)
    means = np.column_stack([hand.fast, hand.trend, hand.slow, hand.peak])
    np.testing.assert_allclose(last["errors"], means, rtol=1e-3, atol=1e-6)
    road = [hand.gap, hand.motion, hand.explained]
    np.testing.assert_allclose(last["bank"][1:], road, rtol=1e-6, atol=1e-12)
    return hand


def with_accelerometer(car, recording, angle):
    """The recording with what an accelerometer shows on a crown: noisy, and lost for a while."""
    t, rng = recording.t, np.random.default_rng(6)
    felt = recording.axle_force.sum(axis=1) / car.mass + 0.3 * rng.standard_normal(t.size)
    felt[(t > 4.0) & (t < 4.6)] = 1e4  # m/s², of no car
    return replace(Bank(vehicle=car, angle=angle, period=7.0).apply(recording), a_y=felt)


@pytest.mark.sweep("0.06-{'share'*")
@pytest.mark.parametrize(
    ("angle", "road"),
    [(0.02, {}), (-0.03, {}), (0.06, {"most": 0.03}), (0.06, {"share": 0.05, "doubt": 0.01})],
    ids=str,
)
def test_step_repeats_the_equations_with_an_accelerometer(angle, road, car, drive):
    """On a crown that is believed, on one that is too steep for a road, and doubting a sensor."""
    recording = with_accelerometer(car, disturbed(drive(n=1500, amplitude=0.08)), angle)
    design = AxleIdentifier.for_vehicle(car)
    design = replace(design, road=replace(design.road, **road))
    hand = assert_by_hand(design, car, recording)
    without = identify(replace(recording, a_y=None), car, design).freeze(1e9)
    assert np.abs(hand.theta - np.hstack([without.W, without.beside_curve])).max() > 1e-3


def with_a_rest(recording):
    """The recording, nearly straight ahead between its third and eighth second."""
    t, rng = recording.t, np.random.default_rng(4)
    share = 1.0 - np.clip(t - 2.0, 0.0, 1.0) + np.clip(t - 8.0, 0.0, 1.0)
    noise = 1e-4 * rng.standard_normal((2, t.size))
    return replace(
        recording,
        v_y=share * recording.v_y + noise[0],
        r=share * recording.r + noise[1],
        delta_f=share * recording.delta_f,
    )


@pytest.mark.sweep("0.02", "0.09")
@pytest.mark.parametrize("dt", [0.004, 0.02, 0.05, 0.09])
def test_step_repeats_the_equations_at_every_rate_above_ten_hertz(dt, car, drive):
    design = AxleIdentifier.for_vehicle(car, dt=dt)
    recording = with_a_rest(drive(n=round(12.0 / dt), dt=dt, amplitude=0.08))
    hand = assert_by_hand(design, car, recording)
    assert hand.time.max() < 10.0  # it rested
    moved = np.abs(hand.theta - np.hstack(design.prior.means(car, design.ladder)))
    assert moved[:, :4].max() > 0.02


def test_what_is_learnt_does_not_depend_on_the_rate(car, drive):
    """Errors are correlated in time: five times the samples are no more evidence."""
    slow = drive(n=750, dt=0.02, amplitude=0.08)
    fast = drive(n=3750, dt=0.004, amplitude=0.08)
    models = [
        identify(one, car, AxleIdentifier.for_vehicle(car, dt=dt)).freeze()
        for one, dt in ((slow, 0.02), (fast, 0.004))
    ]
    slips = np.array([0.01, 0.03, 0.05])
    sds = [model.band.relative_sd(slips) for model in models]
    np.testing.assert_allclose(sds[0], sds[1], rtol=0.15)
    curves = [model.force(slips) for model in models]
    np.testing.assert_allclose(curves[0], curves[1], rtol=0.03)
    np.testing.assert_allclose(models[0].excitation, models[1].excitation, rtol=0.1, atol=0.1)


RARE = {  # settings of regression and detector that bring what rarely happens into every drive
    "errors are clipped": ({"clip": 0.3}, {}),
    "covariance would grow too wide": ({"memory": 0.3, "widest": 0.2}, {}),
    "errors are larger than told": ({"error": 0.01, "relative_error": 0.01}, {}),
    "friction is believed to change": ({}, {"evidence": 0.02, "explains": 0.01}),
    "that is too wide": ({"widest": 0.2}, {"evidence": 0.02, "explains": 0.01}),
    "errors that come suddenly": ({}, {"fast": 0.02, "trend": 30.0}),
}
NEVER = (
    {"clip": 1e6, "widest": 1e6, "error": 0.02, "relative_error": 0.04},
    {"evidence": 1e6, "fast": 1e9},
)


@pytest.mark.sweep("0.01-errors are clipped")
@pytest.mark.parametrize("rare", RARE)
@pytest.mark.parametrize("dt", [0.01, 0.04])
def test_step_repeats_the_equations_where_limits_act(rare, dt, car, drive):
    recording = disturbed(drive(n=1200, dt=dt, amplitude=0.08))
    learnt = []
    for regression, change in (RARE[rare], NEVER):
        design = AxleIdentifier.for_vehicle(car, dt=dt)
        design = replace(design, regression=replace(design.regression, **regression))
        design = replace(design, change=replace(design.change, **change))
        learnt.append(assert_by_hand(design, car, recording))
    limited, free = learnt
    assert np.abs(limited.P / free.P - 1.0).max() > 0.1
    assert np.abs(limited.theta - free.theta).max() > 1e-4


def test_step_repeats_the_equations_through_a_fault(car, drive):
    """A yaw rate a quarter too large for two seconds is doubted, and taken for no road."""
    recording = drive(n=1200, amplitude=0.06)
    wrong = (recording.t >= 5.0) & (recording.t < 7.0)
    recording = replace(recording, r=np.where(wrong, 1.25 * recording.r, recording.r))
    hand = assert_by_hand(AxleIdentifier.for_vehicle(car), car, recording)
    assert not hand.roads and (hand.trend > 1.5).any()


def test_errors_of_sensors_that_are_known_are_taken_out(car, drive):
    right, design = drive(n=900, amplitude=0.06), AxleIdentifier.for_vehicle(car)
    start = design.frozen(car, design.setup(car).carry)
    known = replace(start, sensors=Sensors(0.02, 0.3, 0.1))
    angle, lever, gain = known.sensors
    seen = replace(
        right,
        v_y=right.v_y + angle * right.v_x + lever * right.r,
        delta_f=right.delta_f / (1.0 + gain),
    )
    hand = assert_by_hand(design, car, seen, known)
    unknown, model = (identify(seen, car, design, one).freeze() for one in (start, known))
    assert np.abs(hand.theta[:, :4] - unknown.W).max() > 0.05
    again = AxleModel.from_dict(model.to_dict(), "model")
    assert again.sensors == known.sensors
    frozen = replace(model, sensors=start.sensors).predict(right)
    np.testing.assert_allclose(again.predict(seen), frozen, rtol=0, atol=1e-3)


def test_covariance_grows_again_only_while_it_is_no_wider_than_told(car, drive):
    """A memory of a moment, and no alarm: forgetting alone can widen it, and without limit does."""
    recording, beyond = drive(n=1500, amplitude=0.02), {}
    for widest in (0.3, 0.58, 1e6):
        design = AxleIdentifier.for_vehicle(car)
        design = replace(
            design,
            regression=replace(design.regression, memory=0.1, widest=widest),
            change=replace(design.change, evidence=1e6),
        )
        n = len(design.ladder)
        factors = identify(recording, car, design).state["UD"]  # before each sample, after the last
        P = unpacked(factors.reshape(-1, factors.shape[-1]), n + 3)
        sd = np.sqrt(np.einsum("aii->ai", P))
        assert np.linalg.eigvalsh(P / (sd[:, :, None] * sd[:, None]))[:, 0].min() > -1e-6
        P = P.reshape(*factors.shape[:2], n + 3, n + 3)
        told = design.prior.covariance(car, design.ladder)
        trace, limit = (np.trace(M[..., :n, :n], axis1=-2, axis2=-1) for M in (P, told))
        grew = np.diff(trace, axis=0) > 1e-9 * limit
        beyond[widest] = [(grew & (trace[:-1] > share * limit)).any() for share in (0.3, 0.58)]
    assert not beyond[0.3][0]
    assert beyond[0.58][0] and not beyond[0.58][1]
    assert all(beyond[1e6])
