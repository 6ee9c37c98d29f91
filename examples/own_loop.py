"""Your own simulation follows a path: once a period its state goes in, the steering comes out.

`moved` is a single-track car whose tires saturate: put your simulation, or your car, there.
"""

from math import atan2, cos, sin, tanh

import tireid as ti

EXPECTED_BELOW, DT = 0.05, 0.01  # m, s
CAR = ti.sedan()


def moved(now: ti.VehicleState, steering: float, a_x: float) -> ti.VehicleState:
    """Return the state a period later."""
    X, Y, psi, v_x, r, v_y = *now[:5], now.v_y or 0.0
    m, I_z, l_f, l_r, C_f, C_r = CAR.bicycle
    most_f, most_r = (0.9 * load for load in CAR.axle_loads)
    F_f = most_f * tanh(C_f / most_f * (steering - atan2(v_y + l_f * r, v_x)))
    F_r = most_r * tanh(C_r / most_r * -atan2(v_y - l_r * r, v_x))
    X, Y = X + DT * (v_x * cos(psi) - v_y * sin(psi)), Y + DT * (v_x * sin(psi) + v_y * cos(psi))
    psi, v_y = psi + DT * r, v_y + DT * ((F_f + F_r) / m - v_x * r)
    return ti.VehicleState(X, Y, psi, v_x + DT * a_x, r + DT * (l_f * F_f - l_r * F_r) / I_z, v_y)


def main() -> float:
    """Return the largest deviation from the path [m]."""
    path = ti.paths.Path.from_waypoints([0, 30, 60, 90, 120], [0, 0, 3.5, 3.5, 0])
    tracker = ti.Tracker(path, CAR, speeds=18.0)  # tire=run.tire steers on identified tires
    X, Y, psi = map(float, path.pose(0.0))
    state, off = ti.VehicleState(X, Y, psi, v_x=18.0, r=0.0, v_y=0.0), 0.0
    while state.X < 120.0:
        steering, off = tracker.step(state), max(off, abs(tracker.e_y))
        state = moved(state, steering, a_x=2.0 * (tracker.wanted_speed - state.v_x))
    print(f"at most {100.0 * off:.1f} cm off the path")
    return off


if __name__ == "__main__":
    main()
