"""The certificate of the default against drives that try to break it: is each property true?

    python -m benchmarks.hostile_axle [DRIVES] [--record]

Each property is judged on DRIVES drives of its own, random in car and sampling interval: sensors
that fail in any way, several at once, with NaN, infinity, 1e300 and jumps just within the gate
(`benchmarks.hostile_drives`). No property may be violated.
  boxes, covariance, state, curve, jump   after every sample of the compiled step, in double
  float       boxes and factors of the covariance of the exported C in float, every tenth sample
  drop        friction falls to half in a steady corner: both axles are half wrong no longer than
              is certified; drives that miss a condition of that are drawn again
Beside each, violations are planted: numbers changed in what was recorded, or a design that has
lost what the proof rests on. Each must be found.
"""

import sys
import time
from collections.abc import Callable, Mapping

import numpy as np

from benchmarks.hostile_drives import Case, cases, faster, hostile, ran, told
from benchmarks.hostile_forces import judge_drops
from benchmarks.random_cars import FIRST_SEED
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.axle import AxleIdentifier
from identifier.axle.chosen import CHOSEN as AXLE_CHOSEN
from identifier.axle.covariance import per_variance, triangle, unpacked
from identifier.export.compiled import CompiledPackage
from identifier.export.package import build_package
from models.vehicle import GRAVITY, sedan

DRIVES = 1000
PLANTED = 200  # drives on which a violation is planted, of each kind
ROUNDING = 1e-9
State = Mapping[str, Array]


def boxes(case: Case, state: State) -> bool:
    """Return whether weights and the other parameters lie where they are declared to.

    Parameters
    ----------
    state : carried values, after every sample.
    """
    b, W, own = case.design.bounds, state["W"], state["own"]
    grip, slope = W.sum(axis=2), (W / np.array(case.design.ladder)).sum(axis=2)
    within = [
        (grip, b.least_grip, b.most_grip),
        (slope, b.least_stiffness, b.most_stiffness),
        (W, -b.weight, b.weight),
        (own[:, :, 0], 0.0, b.compliance),
        (own[:, :, 1], 0.0, 1.0),
        (own[:, 0, 2], -b.steering, b.steering),
        (own[:, 1, 2], -b.v_y, b.v_y),
    ]
    return all(((low <= value) & (value <= high)).all() for value, low, high in within)


def covariance(case: Case, state: State) -> bool:
    """Return whether factors are positive and variances within twice the prior's.

    Parameters
    ----------
    state : carried values, after every sample.
    """
    n, design = len(case.design.ladder), case.design
    q, UD = n + 3, state["UD"].reshape(-1, 2, (n + 3) * (n + 4) // 2)
    places = [k for k, (i, j) in enumerate(triangle(q)) if i == j]
    D = UD[:, :, places]
    if not (np.isfinite(UD).all() and (AXLE_CHOSEN.least_variance * (1.0 - 1e-6) <= D).all()):
        return False
    prior = design.prior.covariance(case.vehicle, design.ladder)
    limits = per_variance(prior, n, design.regression.widest)
    P = unpacked(UD.reshape(-1, UD.shape[2]), q).reshape(-1, 2, q, q)
    sizes = np.einsum("kaii->kai", P)
    widths = np.concatenate([sizes[:, :, :n].sum(axis=2, keepdims=True), sizes[:, :, n:]], axis=2)
    return bool((widths * limits <= 1.0 + 1e-5).all())


def finite(case: Case, state: State) -> bool:
    """Return whether every carried number is finite, sensitivity and sway within their limits.

    Parameters
    ----------
    state : carried values, after every sample.
    """
    if not all(np.isfinite(values).all() for values in state.values()):
        return False
    sway, omega = state["sway"].reshape(-1, 3), case.design.sway.frequency
    most = AXLE_CHOSEN.most_sway * GRAVITY * (1.0 + ROUNDING)
    sensitive = np.abs(state["sensitivity"][:, :, 0]).max() * case.vehicle.wheelbase
    return bool(
        sensitive <= AXLE_CHOSEN.most_sensitive * (1.0 + ROUNDING)
        and np.abs(sway[:, 0]).max() <= most
        and np.abs(sway[:, 1]).max() <= omega * most
    )


def curve(case: Case, state: State) -> bool:
    """Return whether every curve opposes its slip, rises and is as flat as certified.

    Parameters
    ----------
    state : carried values, after every sample.
    """
    known, scales = case.certificate, np.array(case.design.ladder)
    shares = np.linspace(0.02, 1.0, 25)[:, None]
    opposes, rises = (shares * known[name].value for name in ("opposes_until", "rises_until"))
    everywhere = np.linspace(0.001, 1.5, 60)[:, None]
    W = state["W"][::5]
    force = W @ np.tanh(opposes / scales).T
    slope = W @ (1.0 / (scales * np.cosh(rises / scales) ** 2)).T
    secant = W @ (np.tanh(everywhere / scales) / everywhere).T
    steepest = known["steepest"].value * (1.0 + ROUNDING)
    return bool((force > 0.0).all() and (slope > 0.0).all() and (secant <= steepest).all())


def jump(case: Case, state: State) -> bool:
    """Return whether no force jumps by more than certified.

    Parameters
    ----------
    state : carried values, after every sample.
    """
    slips = np.geomspace(1e-4, 1.5, 80)[:, None] / np.array(case.design.ladder)
    jumps = np.abs(np.diff(state["W"], axis=0) @ np.tanh(slips).T).max(axis=(1, 2))
    return bool((jumps <= case.certificate["jump"].value * (1.0 + ROUNDING)).all())


def planted(name: str, case: Case, rng: np.random.Generator) -> dict[str, Array]:
    """Return what was recorded with a violation in it.

    Parameters
    ----------
    name : of the property that is violated.
    rng : source of where.
    """
    state = {port: values.copy() for port, values in case.state.items()}
    k, i, j = rng.integers(1, len(state["W"]) // 5) * 5, rng.integers(2), rng.integers(4)
    if name == "boxes":
        state["W"][k, i, j] += 7.0
    elif name == "covariance":
        state["UD"][k, i, 0] = 0.0
    elif name == "state":
        state["filters"][k, i, j] = np.nan
    elif name == "curve":
        state["W"][k, i, 0] -= 8.0
    else:
        state["W"][k:, i, j] += 1.5 * case.certificate["jump"].value
    return state


JUDGES: Mapping[str, Callable[[Case, State], bool]] = {
    "boxes": boxes,
    "covariance": covariance,
    "state": finite,
    "curve": curve,
    "jump": jump,
}


def judge_states(drives: int, t: Targets) -> None:
    """Judge what must hold after every sample.

    Parameters
    ----------
    drives : for each property.
    t : takes the numbers.
    """
    for kind, (name, holds) in enumerate(JUDGES.items()):
        violated, missed, plants = 0, 0, 0
        for number, case in enumerate(cases(kind, drives)):
            violated += not holds(case, case.state)
            if number < PLANTED:
                plants += 1
                spoilt = planted(name, case, np.random.default_rng([32, kind, number]))
                missed += holds(case, spoilt)
        told(t, name, drives, violated, plants, missed)


def judge_designs(drives: int, t: Targets) -> None:
    """Look for violations by designs that have lost what a proof rests on.

    Parameters
    ----------
    drives : at most, until one is found.
    t : takes the numbers.
    """
    for number in range(drives):
        drive = hostile(np.random.default_rng([31, 4, FIRST_SEED + number]))
        state = ran(drive, faster(drive.design))
        case = Case(drive, drive.design.certify(drive.vehicle), state)
        if not jump(case, case.state):
            break
    else:
        number = drives
    t.at_most("jump: drives until a step without a limit is found", number + 1, drives, "",
              "jump/design_found")  # fmt: skip


def judge_float(drives: int, t: Targets) -> None:
    """Judge the exported C in float.

    Parameters
    ----------
    drives : of the sedan.
    t : takes the numbers.
    """
    car = sedan()
    design = AxleIdentifier.for_vehicle(car)
    package = CompiledPackage.of(build_package(design, car), single=True)
    certificate = design.certify(car)
    violated, missed, plants = 0, 0, 0
    for number in range(drives):
        drive = hostile(np.random.default_rng([33, FIRST_SEED + number]), car)
        package.init()
        stored: list[dict[str, Array]] = []
        for part in np.split(drive.samples[:, :5], len(drive.samples) // 10):
            package.run_samples(part)
            stored.append(package.weights)
        state = {name: np.stack([one[name] for one in stored]) for name in ("W", "own", "UD")}
        case = Case(drive, certificate, state)
        violated += not (boxes(case, state) and covariance(case, state))
        if number < PLANTED:
            plants += 1
            rng = np.random.default_rng([34, number])
            missed += boxes(case, planted("boxes", case, rng))
            missed += covariance(case, planted("covariance", case, rng))
    told(t, "float", drives, violated, 2 * plants, missed)


def main(drives: int = DRIVES) -> int:
    """Judge every property; 1 where one was violated or a planted violation was not found.

    Parameters
    ----------
    drives : for each property.
    """
    keep, begin = keeps(), time.perf_counter()
    t = Targets("hostile_axle")
    judge_states(drives, t)
    judge_designs(drives, t)
    judge_float(drives, t)
    judge_drops(drives, t)
    values = list(t.values.items())
    for key in ("drives", "violated", "planted", "missed"):
        total = sum(int(value) for name, value in values if name.endswith(f"/{key}"))
        t.record(f"all/{key}", total)
    print(f"in {time.perf_counter() - begin:.0f} s")
    return t.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:] if word != "--record")))
