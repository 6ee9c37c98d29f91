import casadi as ca
import numpy as np

from identifier.stability.loop import INTEGRAL, Loop
from identifier.stability.margins import gain_margin
from identifier.stability.operation import estimated_input_feedback
from models.bicycle import BicycleParameters, bicycle, slip_angles

CAR = {"m": 1500.0, "I_z": 2500.0, "l_f": 1.15, "l_r": 1.55}
STIFFNESS = (127700.0, 106000.0)
FULL = BicycleParameters(*CAR.values(), *STIFFNESS)
SATURATED = estimated_input_feedback(FULL, 20.0)


def test_the_feedback_is_the_jacobian_of_what_the_linear_tire_misses():
    p = FULL
    x, v_x = ca.SX.sym("x", 2), 20.0
    alpha = slip_angles(p.l_f, p.l_r, v_x, x, ca.DM([0.02, 0.0]))
    C = ca.vertcat(p.C_f, p.C_r)
    peak = ca.DM([4000.0, 3500.0])
    missed = peak * ca.tanh(C * alpha / peak) - C * alpha
    at = np.array([-0.8, 0.3])
    J_f = np.array(ca.Function("J", [x], [ca.jacobian(missed, x)])(at))
    lost = C * ca.tanh(C * alpha / peak) ** 2  # C - F'
    lost_at = np.array(ca.Function("lost", [x], [lost])(at)).ravel()
    K = np.array(ca.DM(bicycle(p, v_x).K))
    found = estimated_input_feedback(BicycleParameters(*CAR.values(), *lost_at), v_x)
    np.testing.assert_allclose(found, J_f @ K, rtol=1e-10)
    assert not np.allclose(found, J_f @ K.T, rtol=1e-2)  # (6) prints the transpose


def test_the_coupling_is_symmetric_and_positive_so_that_the_decay_it_takes_is_a_real_eigenvalue():
    N = estimated_input_feedback(BicycleParameters(*CAR.values(), 1.0, 1.0), 1.0)
    np.testing.assert_allclose(N, N.T)
    assert np.linalg.eigvalsh(N)[0] > 0.0
    assert np.abs(np.linalg.eigvals(SATURATED).imag).max() == 0.0
    assert 5.0 < np.linalg.eigvals(SATURATED).real.max() < 12.0


def test_below_the_decay_that_it_takes_no_learning_rate_saves_the_loop_that_reads_the_estimate():
    least = np.linalg.eigvals(SATURATED).real.max()
    for a, stable in ((0.95 * least, False), (1.3 * least, True)):
        loop = Loop(
            A_d=-a * np.eye(2), forgetting=a, law=INTEGRAL, G=np.eye(2), input_feedback=SATURATED
        )
        assert (gain_margin(loop).factor > 0.0) is stable
