"""Every method on a slalom whose signals fail now and then: estimates must stay finite."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks.targets import Targets, show
from codegen.arrays import Array
from identifier.compare.course import Course
from identifier.method import CannotFreezeError
from identifier.methods import LIVE, METHODS, make_method
from identifier.run import identify
from models.recordings import Recording
from models.vehicle import sedan
from tireid.commands.demo_story import plant_recordings

SIGNALS = ("v_x", "v_y", "r", "delta_f")
EVERY, LASTS = 500, 40  # samples: a fault every 5 s, of 0.4 s


def faults(targets: Targets) -> None:
    """Count estimates that are not finite; show what the default still learns.

    Parameters
    ----------
    targets : collects what is missed.
    """
    car = sedan()
    clean = plant_recordings(car, np.random.default_rng(0))[0]
    course = Course(vehicle=car, recordings=(clean,), min_speed=make_method(LIVE, car).min_speed)
    print("Slalom with faults, every method")
    for fault, recording in faulty(clean, np.random.default_rng(0)).items():
        lost = []
        for name in METHODS:
            history = identify(recording, car, make_method(name, car))
            finite = np.isfinite(history.axle_force).all()
            try:
                force = history.design.frozen(car, history.state_at(clean.t[-1]))
                finite = finite and np.isfinite(force.predict(recording)).all()
            except CannotFreezeError:
                pass
            except ValueError:
                finite = np.bool_(False)
            lost += [] if finite else [name]
            if name == LIVE and finite:
                error = course.share(clean.name, course.error(clean, force.predict(clean)))
                show(f"{fault}: {LIVE} frozen, on the clean slalom", f"{error:.1f} %")
                targets.record(f"faults/{_slug(fault)}/{LIVE}", error, "%")
        text = f" ({', '.join(lost)})" if lost else ""
        label = f"{fault}: methods that are not finite{text}"
        targets.at_most(label, len(lost), 0, "", key=f"faults/{_slug(fault)}/lost")


def faulty(clean: Recording, rng: np.random.Generator) -> Mapping[str, Recording]:
    """Return the recording with one kind of fault each.

    Parameters
    ----------
    clean : the recording.
    rng : of the size of spikes.
    """
    n = len(clean)
    starts = np.arange(EVERY, n - LASTS, EVERY)
    gap = (np.arange(n)[:, None] - starts >= 0) & (np.arange(n)[:, None] - starts < LASTS)
    lost = gap.any(axis=1)
    held = np.arange(n)
    for start in starts:
        held[start : start + LASTS] = start
    spikes = np.zeros(n)
    spikes[starts] = rng.standard_normal(starts.size)
    middle = (np.arange(n) > n // 2) & (np.arange(n) < n // 2 + 300)
    signals = {name: getattr(clean, name) for name in SIGNALS}
    return {
        "zeros for 0.4 s": _with(clean, {k: np.where(lost, 0.0, s) for k, s in signals.items()}),
        "stuck for 0.4 s": _with(clean, {k: s[held] for k, s in signals.items()}),
        "spikes of 10": _with(clean, {k: s + 10.0 * spikes for k, s in signals.items()}),
        "spikes of 1000": _with(clean, {k: s + 1e3 * spikes for k, s in signals.items()}),
        "standstill": _with(clean, {k: np.where(middle, 0.0, s) for k, s in signals.items()}),
    }


def _slug(words: str) -> str:
    return words.replace(" ", "_")


def _with(clean: Recording, signals: Mapping[str, Array]) -> Recording:
    return replace(
        clean,
        v_x=signals["v_x"],
        v_y=signals["v_y"],
        r=signals["r"],
        delta_f=signals["delta_f"],
    )
