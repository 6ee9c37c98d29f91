import numpy as np
import pytest

from identifier.stability.limit_cycle import (
    NoLimitCycleError,
    _line_leak,
    _sampled,
    limit_cycle,
    sampled_limit_cycle,
)
from identifier.stability.limits import critical_frequency, integral_euler_limit, integral_limit


def simulated(a, lam, g, rho, dt, duration=150.0):
    """Mean |ξ̃| and frequency [rad/s] of the loop with its leakage, stepped with Euler."""
    # not all along one line: from such a start no orbit but the line can ever be reached
    xi, z, p = np.zeros(2), np.array([0.0, 0.02]), np.array([0.1, 0.03])
    errors = np.empty((round(duration / dt), 2))
    for k in range(len(errors)):
        errors[k] = xi
        leak = rho * np.hypot(*xi)
        xi, z, p = (
            xi + dt * (-a * xi - p),
            z + dt * (xi - lam * z),
            p + dt * (g / a * z - leak * p),
        )
    late = errors[len(errors) // 2 :]
    rises = np.flatnonzero((late[:-1, 0] < 0.0) & (late[1:, 0] >= 0.0))
    period = dt * (rises[-1] - rises[0]) / (len(rises) - 1)
    return np.hypot(*late.T).mean(), 2 * np.pi / period


@pytest.mark.parametrize(
    ("a", "lam", "beyond"),
    [
        (7.0, 5.0, 1.3),
        (3.0, 8.5, 2.8),
        (9.0, 5.0, 2.0),
        (6.0, 0.6, 3.0),
        (6.0, 1.2, 1.5),
        (9.0, 2.5, 2.0),
    ],
)
def test_the_limit_cycle_of_the_sampled_loop_is_that_of_the_harmonic_balance(a, lam, beyond):
    dt, rho = 0.01, 0.7
    g = beyond * integral_euler_limit(a, lam, dt)
    amplitude, frequency = simulated(a, lam, g, rho, dt)
    cycle = sampled_limit_cycle(a=a, lam=lam, g=g, rho_W=rho, dt=dt)
    assert amplitude == pytest.approx(cycle.amplitude, rel=0.02)
    assert frequency == pytest.approx(cycle.frequency, rel=0.01)


def test_where_the_filter_forgets_slowly_the_error_goes_round_a_circle_and_not_along_a_line():
    a, lam, rho, dt = 6.0, 0.6, 0.7, 0.01
    g = 3.0 * integral_euler_limit(a, lam, dt)
    amplitude, _ = simulated(a, lam, g, rho, dt)
    line = _sampled(_line_leak, a, lam, g, rho, dt)
    assert amplitude > 1.12 * line.amplitude
    m = sampled_limit_cycle(a=a, lam=lam, g=g, rho_W=rho, dt=1e-5).leakage
    assert a * (m + a) * (m + lam) * (a + lam) == pytest.approx(g, rel=1e-3)


def test_a_circular_error_would_have_a_smaller_amplitude_than_the_one_that_is_seen():
    a, lam, rho, dt = 3.0, 8.5, 0.7, 0.01
    g = 2.8 * integral_euler_limit(a, lam, dt)
    circular = np.roots([1.0, a + lam, a * lam - g / (a * (a + lam))]).real.max() / rho
    amplitude, _ = simulated(a, lam, g, rho, dt)
    assert amplitude > 1.15 * circular


def test_the_sampled_cycle_goes_over_into_the_continuous_one():
    g = 1.7 * integral_limit(6.0, 4.0)
    continuous = limit_cycle(a=6.0, lam=4.0, g=g, rho_W=0.3)
    sampled = sampled_limit_cycle(a=6.0, lam=4.0, g=g, rho_W=0.3, dt=1e-4)
    assert sampled.amplitude == pytest.approx(continuous.amplitude, rel=5e-3)
    assert sampled.frequency == pytest.approx(continuous.frequency, rel=5e-3)


def test_the_cycle_is_born_at_the_limit_with_the_critical_frequency():
    cycle = limit_cycle(a=6.0, lam=4.0, g=(1 + 1e-9) * integral_limit(6.0, 4.0), rho_W=0.3)
    assert cycle.amplitude == pytest.approx(0.0, abs=1e-7)
    assert cycle.frequency == pytest.approx(critical_frequency(6.0, 4.0), rel=1e-6)


def test_there_is_no_cycle_within_the_limit():
    with pytest.raises(NoLimitCycleError, match="within the limit"):
        limit_cycle(a=6.0, lam=4.0, g=0.99 * integral_limit(6.0, 4.0), rho_W=0.3)
    with pytest.raises(ValueError, match="rho_W must be positive"):
        limit_cycle(a=6.0, lam=4.0, g=1e9, rho_W=0.0)
