"""One's own optimal control problem on learnt tires: the shortest lane change, by collocation.

A car at 20 m/s learns its tires, and the equations of motion that they make, a CasADi function,
enter a problem of one's own: change the lane by 3.5 m in the shortest time, with slip kept to half
of what the tires are known for. The steering found is given to the true car, open loop, once on
learnt tires and once on the linear ones of its file.
"""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import tireid as ti
from mpc.cars import DoubleTrackCar

EXPECTED_BELOW = 0.5
V_X, LANE = 20.0, 3.5  # m/s, m
STEPS, RATE = 30, 0.8  # of the horizon; rad/s of the road wheels
RADAU = ca.collocation_points(3, "radau")


def lane_change(tire: ti.TireModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times [s] and steering angles [rad] of the shortest lane change on some tires."""
    motion = tire.casadi_function().dynamics  # x = [v_y, r, lagged slips], δ, v_x -> ẋ, forces
    n = motion.size1_in("x") + 3  # and Y, psi, δ
    s, rate = ca.SX.sym("s", n), ca.SX.sym("rate")
    Y_dot = V_X * ca.sin(s[1]) + s[3] * ca.cos(s[1])
    s_dot = ca.vertcat(Y_dot, s[4], rate, motion(s[3:], s[2], V_X)[0])
    f = ca.Function("f", [s, rate], [s_dot])

    problem = ca.Opti()
    S, U, T = problem.variable(n, STEPS + 1), problem.variable(STEPS), problem.variable()
    h, (C, D, _) = T / STEPS, ca.collocation_coeff(RADAU)
    for k in range(STEPS):
        inner = problem.variable(n, len(RADAU))
        polynomial = ca.horzcat(S[:, k], inner)
        problem.subject_to(polynomial @ C == h * f(inner, ca.repmat(U[k], 1, len(RADAU))))
        problem.subject_to(S[:, k + 1] == polynomial @ D)
    if tire.known_slip is not None:  # the rest of the grip is for what is not known
        limit = ca.repmat(0.5 * tire.known_slip, 1, STEPS + 1)
        problem.subject_to(problem.bounded(-limit, S[5:, :], limit))
    problem.minimize(T + 1e-3 * ca.sumsqr(U) * h)
    problem.subject_to(S[:, 0] == 0)
    problem.subject_to(S[:, STEPS] == ca.vertcat(LANE, ca.DM.zeros(n - 1)))
    problem.subject_to(problem.bounded(-RATE, U, RATE))
    problem.subject_to(problem.bounded(0.5, T, 5.0))
    problem.set_initial(T, 2.0)
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    solution = problem.solve()
    delta = np.asarray(solution.value(S[2, :]))
    return np.linspace(0.0, float(solution.value(T)), STEPS + 1), delta


def driven(t: NDArray[np.float64], delta: NDArray[np.float64]) -> float:
    """Return how far off its lane the true car is at the end [m]."""
    car = DoubleTrackCar(ti.sedan())
    state = car.start(V_X)
    while state.t < t[-1]:
        state = car.step(state, float(np.interp(state.t, t, delta)), V_X)
    return abs(state.Y - LANE)


def main() -> float:
    """Return how far off its lane the car ends on learnt tires, over that on linear ones [-]."""
    car = ti.sedan()
    log = ti.sample_recording(car)  # or ti.read_recording("log.csv")
    missed = {}
    for name, method in (("learnt", None), ("linear", ti.make_method("linear", car))):
        t, delta = lane_change(ti.identify(log, car, method).freeze())
        missed[name] = driven(t, delta)
        print(f"{name}: {t[-1]:.2f} s, the true car ends {missed[name]:.2f} m off its lane")
    return missed["learnt"] / missed["linear"]


if __name__ == "__main__":
    main()
