"""What a figure shows, in a sentence computed from the data that it draws."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from codegen.arrays import Array
from identifier.doctor.readings import Motion, Reading, forces_and_slips
from identifier.paper.design import VARIANTS
from identifier.run import History
from identifier.tire_model import TireModel
from identifier.verdict import RoadFriction, Verdict, WindowForces
from identifier.verdict.verdict import PERCENT
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid.figures.drive import AT_THE_END
from tireid.figures.tires import TireCurve, axle_slip, forces_over_slip

if TYPE_CHECKING:
    from mpc.loop.record import Drive
    from tireid.figures.paper import Quartiles

_CURVE = 200  # points at which a band is compared with the points of a drive
_SETTLED = 0.1  # of its last value: an estimate within it has converged
_PLACES = ("at small slip", "near the end of the identified slip", "beyond the identified slip")


def percents(shares: Array | tuple[float, ...], digits: int = 0) -> str:
    """Return shares of front and rear: 3 / 9 %."""
    return " / ".join(f"{PERCENT * share:.{digits}f}" for share in shares) + " %"


def slip_caption(
    model: TireModel, recording: Recording, windows: WindowForces | None = None
) -> str:
    """Return how many of the drawn points lie outside the band, and where."""
    said, band, known = "Axle force over slip angle", model.band, model.known_slip
    if band is None or known is None:
        return f"{said} of {recording.name}, and the curve of the model."
    drawn = forces_over_slip(model, recording, windows)
    what, slip = "forces from the motion" if windows else "modelled forces", drawn.slip
    what = what if recording.axle_force is None else "true forces"
    at = np.linspace(slip.min(), slip.max(), _CURVE)
    low, high = band.at(at)
    outside = np.stack(
        [
            (y < np.interp(x, at, low[:, k])) | (y > np.interp(x, at, high[:, k]))
            for k, (x, y) in enumerate(zip(slip.T, drawn.measured.T, strict=True))
        ],
        axis=1,
    )
    places = np.sum(np.abs(slip[..., None]) > known[:, None] * [0.5, 1.0], axis=2)[outside]
    counts = np.bincount(places, minlength=3)
    share = percents(outside.mean(axis=0))
    some = 2 * counts.max() > places.size and share != "0 / 0 %"
    most = f", most {_PLACES[counts.argmax()]}" * bool(some)
    return f"{said}: {share} of the {what} lie outside the steady band (front / rear){most}."


def force_caption(
    recording: Recording, force: Array, model: TireModel, verdict: Verdict | None
) -> str:
    """Return how well a model replays a drive.   verdict : on it; None leaves it out."""
    said, what = f"Axle forces of {recording.name}, by the model", "true force"
    windows = None if verdict is None else verdict.forces
    t, known, shares = recording.t, recording.axle_force, None
    if known is not None:
        moves = recording.v_x >= model.min_speed
        t, known, force = t[moves], known[moves], force[moves]
        size, rms = (np.sqrt(np.mean(one**2, axis=0)) for one in (known, force - known))
        shares = rms / size if size.min() > 0.0 else None
    elif windows is not None and verdict is not None:
        (t, known, force, _), shares, what = windows, verdict.model_error, "force in the motion"
    if verdict is not None and not verdict.valid:
        said = f"{verdict.word[0].upper()}{verdict.word[1:]}. {said}"
    if known is None:
        return f"{said}."
    far = np.abs(force - known)
    row, axle = np.unravel_index(far.argmax(), far.shape)
    rms = f"{percents(shares, 1)} of the {what} (front / rear), " if shares is not None else ""
    most = f"largest {far.max():.0f} N at {t[row]:.4g} s, {('front', 'rear')[axle]}"
    return f"{said}: error {rms}{most}."


def settled_caption(learnt: History) -> str:
    """Return from when on the first estimate of an identifier stays near its last value."""
    found = [(block.part, learnt.tracks_over(block)[0]) for block in learnt.blocks()]
    values = np.concatenate([track.values for _, track in found])
    far = np.abs(values / values[-1] - 1.0) > _SETTLED
    last = [int(np.flatnonzero(axle)[-1]) if axle.any() else 0 for axle in far.T]
    front, rear = (f"{learnt.recording.t[k]:.3g}" for k in last)
    return (
        f"Estimates over time: the {found[0][1].title} stays within {PERCENT * _SETTLED:.0f} % of "
        f"its last value from {front} / {rear} s on (front / rear)."
    )


def inputs_caption(recording: Recording) -> str:
    """Return the range of the signals of a log."""
    v, most = (
        recording.v_x,
        {
            "steering": (np.degrees(recording.delta_f), "°"),
            "yaw rate": (np.degrees(recording.r), "°/s"),
            "v_y": (recording.v_y, " m/s"),
            "a_y": (recording.a_y, " m/s²"),
        },
    )
    ranges = [
        f"{name} up to {np.abs(one).max():.3g}{unit}"
        for name, (one, unit) in most.items()
        if one is not None
    ]
    return (
        f"Signals of {recording.name}: v_x {v.min():.3g} to {v.max():.3g} m/s, {', '.join(ranges)}."
    )


def friction_caption(friction: RoadFriction) -> str:
    """Return the friction of a road over that of the identification drive, and its extremes."""
    low, middle, high = np.quantile(friction.ratio, [0.0, 0.5, 1.0])
    return (
        f"Friction of the road over that of the identification drive: median {middle:.2f}, "
        f"{low:.2f} to {high:.2f}; {friction.text}."
    )


def diagnosis_caption(
    recording: Recording, vehicle: Vehicle, repaired: Recording, car: Vehicle
) -> str:
    """Return how far force and slip rise together, as logged and as repaired."""
    logs = {"as logged": (recording, vehicle)}
    if repaired is not recording:
        logs["repaired"] = (repaired, car)
    found = []
    for name, (one, given) in logs.items():
        motion = Motion.of(one)
        if motion is not None:
            axles = forces_and_slips(motion, given, Reading())
            pairs = zip(axles.slip, axles.force, strict=True)
            front, rear = (np.corrcoef(slip, force)[0, 1] for slip, force in pairs)
            found.append(f"{front:.2f} / {rear:.2f} {name}")
    if not found:
        return "Force over slip angle: too little is driven."
    return f"Force over slip angle: correlation {', '.join(found)} (front / rear)."


def curves_caption(
    drive: "Drive", curves: Sequence[TireCurve], drops: Sequence[tuple[float, float]]
) -> str:
    """Return the forces of a drive over those of curves at its slip, where these are drawn.

    drops : arc length [m] from which friction is another, and which: curves of the end count from
        the last on, the others up to the first.
    """
    slip, force, said = axle_slip(drive), drive.axle_force, dict[str, list[str]]()
    first, last = (drops[0][0], drops[-1][0]) if drops else (np.inf, -np.inf)
    for curve in curves:
        driven, where = drive.s < first, f" up to {first:g} m"
        if curve.label.endswith(AT_THE_END):
            driven, where = drive.s >= last, f" from {last:g} m on"
        drawn = zip(slip.T, curve.force.T, strict=True)
        at = np.stack([np.interp(x, curve.alpha, y, np.nan, np.nan) for x, y in drawn], axis=1)
        at = np.nan_to_num(at) * driven[:, None]
        power = np.sum(at**2, axis=0)
        if power.all():
            share = percents(np.sum(at * force, axis=0) / power)
            said.setdefault(where * bool(drops), []).append(f"{curve.label} {share}")
    found = "; ".join(f"{', '.join(one)}{where}" for where, one in said.items())
    return (
        "True force of the first drive over that of the curves at its slip (front / rear): "
        f"{found or 'no slip'}."
    )


def comparison_caption(
    results: Mapping[str, Mapping[str, "Quartiles"]],
    paper: Mapping[str, Mapping[str, float]],
) -> str:
    """Return in how many columns laws err less than the first, here and as the paper prints."""
    (first, *others), found = results, []
    medians = {law: {name: q[0] for name, q in row.items()} for law, row in results.items()}
    for law in others:
        said = []
        for table, whose in ((medians, "{} of {} columns"), (paper, "{} of the paper's {}")):
            row, least = table.get(law, {}), table.get(first, {})
            less = [row[name] < least[name] for name in row if name in least]
            said += [whose.format(sum(less), len(less))] * bool(less)
        found += [f"{VARIANTS[law].title} in {', '.join(said)}"] * bool(said)
    return (
        f"Median error below that of {VARIANTS[first].title}: "
        f"{'; '.join(found) or 'nothing to compare'}. Hollow marks are the paper's values."
    )
