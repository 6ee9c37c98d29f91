"""What a tracker would plan with other weights, in the situation that it is in."""

from mpc.realtime import Tracker
from mpc.tires import TireModel
from mpc.tires.reach import reach_of


def previewed_rate(tracker: Tracker, tire: TireModel) -> float:
    """Return the first steering rate of the plan after one more iteration with a tire [rad/s].

    From the plan and the road of the last step; the tracker is left as it was.

    Parameters
    ----------
    tracker : after a step.
    tire : of the same structure.

    Raises
    ------
    ValueError
        Where the structure is another.
    """
    if tire.structure != tracker.tire.structure:
        raise ValueError(f"the tracker is built for {tracker.tire.structure}, not {tire.structure}")
    instance = tracker.instance
    state, params = instance.state.copy(), instance.params.copy()
    instance.start[:] = state["x"][0]
    params_now = instance.params
    params_now["weights"], params_now["car"] = tire.weights, tire.car
    reach = reach_of(tire, tracker.problem.limits.slip)
    params_now["max_slip"], params_now["rise"] = reach
    instance.solve()
    rate = float(instance.state["u"][0])
    instance.state[...], instance.params[...] = state, params
    return rate
