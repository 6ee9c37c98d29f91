"""The package: C sources, example, self-test, build file, README and manifest, as texts by path."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from codegen.package import (
    about_package,
    c_files,
    check_name,
    cmake,
    content_head,
    header,
    manifest_text,
    plain,
    rows,
)
from codegen.template import Values, Words, filled
from identifier.export.c_source import PREFIX, PROGRAMS, C, c_sources
from identifier.export.layout import carried_members, rules
from identifier.export.specialize import (
    ACCELERATION,
    SIDE_SLIP,
    Signal,
    SpecializedStep,
    specialize,
)
from identifier.frozen import vehicle_numbers
from identifier.method import Method
from identifier.refused import NOWHERE, STALE_TIME, stale_samples
from identifier.tire_model import TireModel
from models.vehicle import Vehicle

_SAMPLES = 240  # of the self-test
_REST = 10  # samples at rest, and some as long in between
# largest difference of a force that the self-test allows, of the limit of forces
_TOLERANCE_DOUBLE = 1e-8
_TOLERANCE_SINGLE = 2e-5  # likewise, in float

# <name>.json: everything that went into a package, what is in it, and their hashes.

FORMAT = "tireid package 1"
FLAGS = ("-ffp-contract=off", "-fno-math-errno")  # of the library


def ingredients(specialized: SpecializedStep, *, single: bool) -> dict[str, Any]:
    """Return everything that a package is made of, ready for JSON.
    single : whether float is the default precision.
    """
    method = specialized.method
    numbers: Any = asdict(method) if is_dataclass(method) else {}
    return {
        **content_head(FORMAT, specialized.name, single=single),
        "method": {"kind": type(method).__name__, **plain(numbers)},
        "certificate": certificate(method, specialized.vehicle),
        "vehicle": plain(vehicle_numbers(specialized.vehicle)),
        "sample_time_s": specialized.dt,
        "min_speed_m_s": specialized.min_speed,
        "limits": {
            "speed_m_s": specialized.limits.speed,
            "yaw_rate_rad_s": specialized.limits.yaw_rate,
            "steering_rad": specialized.limits.steering,
            "force_N": specialized.limits.force,
        },
        "inputs": [_described(signal) for signal in specialized.inputs],
        "outputs": [_described(signal) for signal in specialized.outputs],
        **({"band": plain(specialized.band)} if specialized.tells_band else {}),
        "carried": [
            {
                **_described(signal),
                "learnt": signal.name in specialized.learnt,
                "shape": list(specialized.carry[signal.name].shape),
                "start": plain(specialized.carry[signal.name].tolist()),
            }
            for signal in specialized.state
        ],
    }


def certificate(method: Method, vehicle: Vehicle) -> dict[str, Any]:
    """Return what is proven of a method, as the manifest says it."""
    if method.judged_by:
        verdict = f"judged by {method.judged_by}"
        return {"verdict": verdict, "properties": {}, "limits": {}}
    found = method.certify(vehicle)
    table = found.to_dict()
    return {name: table[name] for name in ("verdict", "properties", "limits")}


def summary(specialized: SpecializedStep, content: Mapping[str, Any]) -> dict[str, str | Words]:
    """Return what texts say about a package: title, method, versions, hash, names and numbers.
    content : what `ingredients` returned.
    """
    return {
        **about_package(content, f"Tire forces of the car {specialized.vehicle.name}"),
        "method": type(specialized.method).__name__,
        "certificate": _certificate_text(specialized.method, content["certificate"]),
        "dt": f"{specialized.dt:g}",
        "min_speed": f"{specialized.min_speed:.3g}",
    }


def _certificate_text(method: Method, proven: Mapping[str, Any]) -> str:
    if method.whole:
        return (
            "Tires of a fit have no certificate. How far their forces are off,\n"
            "`tireid predict LOG --weights weights.json` says of a drive that they do not know."
        )
    if method.judged_by:
        return (
            "Stability and error bounds of this method depend on its gains: "
            f"`{method.judged_by}` on its\n"
            "design file gives the certificate. None is part of this package."
        )
    verdict, limits = proven["verdict"], proven["limits"]
    proven_of = proven["properties"].values()
    if proven_of:
        lines = [f"Certificate of this method, for the interval it was built for: **{verdict}**.\n"]
        lines += ["| property | value | limit | unit | |", "|---|---|---|---|---|"]
        lines += [
            f"| {one['title']} | {_number(one['value'])} | {_number(one['limit'])} "
            f"| {one['unit']} | {one['status']} |"
            for one in proven_of
        ]
        lines.append("")
    else:
        lines = [f"This method is **{verdict}**: no margin and no bound of its error is proven."]
    if limits:
        lines.append("Limits by construction after every sample, for any measurement, in both")
        lines.append("precisions, of what it learns:\n")
        lines += ["| bound | |", "|---|---|", *(f"| {key} | {limits[key]} |" for key in limits)]
    return "\n".join(lines)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _described(signal: Signal) -> dict[str, Any]:
    return {key: value for key, value in signal._asdict().items() if key != "rule"}


# Samples for the self-test of a package, and the forces that CasADi gives for them.


def synthetic_samples(specialized: SpecializedStep, n: int = _SAMPLES) -> Array:
    """Return a start from rest and turns to both sides, (n, k); arithmetic only, no noise.

    Where v_y is given it is measured at the end alone; a_y is that of the motion, with a gap.
    n : number of samples.
    """
    k = np.arange(n)
    wave, slow = _triangle(k / 60.0), _triangle(k / 97.0 + 0.2)
    v_x = specialized.min_speed * np.minimum(0.0973 * np.maximum(k - _REST, 0.0), 15.0)
    v_x = np.where((k >= n // 2) & (k < n // 2 + _REST), 0.5 * specialized.min_speed, v_x)
    v_y = 0.03 * v_x * slow
    r = 0.4 * specialized.min_speed * wave * np.minimum(k / n, 0.5)
    delta_f, delta_r = 0.05 * wave, 0.005 * slow
    a_y = np.gradient(v_y, specialized.dt) + v_x * r
    a_y[5 * n // 8 : 6 * n // 8] = np.nan
    measured = v_y if not specialized.tells_v_y else np.where(k < 7 * n // 8, np.nan, v_y)
    return np.column_stack([v_x, measured, r, delta_f, delta_r, *[a_y] * specialized.reads_a_y])


def _triangle(phase: Array) -> Array:
    return 4.0 * np.abs(phase - np.floor(phase + 0.5)) - 1.0


def run_in_virtual_machine(
    specialized: SpecializedStep, samples: Array
) -> tuple[Array, dict[str, Array]]:
    """Return the outputs (n, k) of a specialized step, one beside the other, and its state then.

    Samples that are refused count as time, as `identifier.refused` says.
    samples : (n, k) in the order of the inputs.
    """
    limits, method = specialized.limits, specialized.method
    state = [np.asarray(value) for value in specialized.carry.values()]
    now, refused, started = np.zeros(sum(port.size for port in specialized.outputs)), 0, False
    table = []

    def step(sample: Array) -> Array:
        v_x, v_y, r, delta_f, delta_r, *a_y = sample
        x, delta = (limits.plausible(v_y), r), (delta_f, delta_r)
        results = [np.array(one) for one in specialized.function(*state, x, delta, v_x, *a_y)]
        state[:], outputs = results[: len(state)], results[len(state) :]
        return np.concatenate([one.ravel(order="F") for one in outputs])

    absent = np.array([port == ACCELERATION for port in specialized.inputs])
    nowhere = np.where(absent, np.nan, 0.0)
    nowhere[:2] = NOWHERE, np.nan if specialized.tells_v_y else 0.0
    for sample in samples:
        if limits.accept(*sample[:5], needs_v_y="v_y" in method.needs):
            anew = specialized.believed is None and refused > 0
            if anew if started else specialized.rests_first:
                rest = np.where(absent, np.nan, sample)
                step(np.array([0.0, *rest[1:]]))
            now = step(sample)
            refused, started = 0, True
        else:
            refused += 1
            if specialized.believed is not None and started:
                now = step(nowhere)
            if refused >= stale_samples(STALE_TIME, specialized.dt):
                now = np.zeros_like(now)
        table.append(now)
    return np.array(table), dict(zip(specialized.carry, state, strict=True))


def vectors_header(specialized: SpecializedStep, most: int = _SAMPLES) -> str:
    samples = synthetic_samples(specialized)
    outputs, _ = run_in_virtual_machine(specialized, samples)
    samples, outputs = samples[:most], outputs[:most]
    double, single = _tolerances(specialized)
    kept = rules([member for member in carried_members(specialized) if member.learnt])
    names = ", ".join(port.name for port in specialized.inputs)
    size = len(specialized.inputs)
    negative = [f"#define VECTOR_NOT_NEGATIVE {rule.first}U /* a weight */\n" for rule in kept]
    return header(
        f"{specialized.name}_vectors.h",
        f"Generated. Samples {names} [SI] and forces front, rear [N].",
        [
            f"#define VECTORS {len(samples)}\n"
            f"#define VECTOR_TOLERANCE_DOUBLE {double} /* N */\n"
            f"#define VECTOR_TOLERANCE_SINGLE {single} /* N */\n" + "".join(negative[:1]),
            f"static const double vector_input[VECTORS][{size}] = {{\n{rows(samples)}}};\n",
            f"static const double vector_force[VECTORS][2] = {{\n{rows(outputs[:, :2])}}};\n",
        ],
    )


class Package(NamedTuple):
    """A package before it is written: its step, its files by path, title, version and hash."""

    specialized: SpecializedStep
    files: Mapping[str, str]
    about: Values


def build_package(
    method: Method,
    vehicle: Vehicle,
    start: TireModel | None = None,
    *,
    name: str = "tireid",
    single: bool = False,
    with_a_y: bool = False,
    with_band: bool = False,
) -> Package:
    """Return the package of a method for a car; the same input gives the same bytes.
    start : weights to begin with; None begins with those of the method.
    single : whether float is the default precision.
    with_a_y : whether a_y is an input of a method that goes without it as well.
    with_band : whether half the width of the band is an output, calibrated as `start` is.
    """
    check_name(name)
    specialized = specialize(method, vehicle, start, name, with_a_y=with_a_y, with_band=with_band)
    content = ingredients(specialized, single=single)
    about = summary(specialized, content)
    files = c_sources(specialized, single=single, about=about)
    files |= {
        **c_files(C, PROGRAMS, {PREFIX: name}),
        f"tests/{name}_vectors.h": vectors_header(specialized),
    }
    files |= cmake(files, about, flags=FLAGS, so_that="square roots without a call")
    return Package(specialized, files | {f"{name}.json": manifest_text(content, files)}, about)


def _tolerances(specialized: SpecializedStep) -> tuple[str, str]:
    """Return the largest difference of a force that the self-test allows [N], double and float."""
    force = specialized.limits.force
    return f"{_TOLERANCE_DOUBLE * force:.2g}", f"{_TOLERANCE_SINGLE * force:.2g}"


def readme(package: Package, about_figures: str) -> str:
    specialized = package.specialized
    state = carried_members(specialized)
    shapes = [" x ".join(map(str, m.dimensions)) or "1" for m in state]
    carried = [
        f"| `{m.path}` | {shape} | {m.signal.unit} | {m.signal.description} |\n"
        for m, shape in zip(state, shapes, strict=True)
    ]
    double, single = _tolerances(specialized)
    equations = package.files[f"src/{specialized.name}_equations.c"]
    called = [f"`{word}`" for word in ("sqrt", "fabs", "floor") if f" {word}(x)" in equations]
    return filled(
        C / "README.md",
        {
            "input_table": _table(specialized.inputs),
            "output_table": _table(specialized.outputs),
            "carry_table": "".join(carried),
            "modes": _modes(specialized),
            **_about_learning(specialized),
            "stale_time": f"{STALE_TIME:g}",
            **_about_signals(specialized),
            **_about_refused(specialized),
            "libraries": f"{', '.join(called) or 'nothing'} of `<math.h>`, copies of structures",
            "samples": str(_SAMPLES),
            "tolerance_double": double,
            "tolerance_single": single,
            "figures": about_figures,
            **package.about,
        },
    )


def _modes(specialized: SpecializedStep) -> str:
    if not specialized.learnt:
        rest = ": there are no weights to read, set or freeze."
        if specialized.method.whole:
            return f"The tires of the fit stay as they are{rest}"
        return f"This method estimates a signal{rest}"
    name = specialized.name
    learnt = ", ".join(specialized.learnt)
    return (
        f"`{name}_set_adaptation(&state, false)` freezes what is identified ({learnt});\n"
        "observers and filters continue, so that it may be switched on again at any time. "
        f"`{name}_get_weights` and\n`{name}_set_weights` store it and bring it back, "
        f"`{name}_reset` begins anew with it, `{name}_init`\nforgets it."
    )


def _about_learning(specialized: SpecializedStep) -> dict[str, str]:
    """Return what is said of forces whose tires are identified, and of others."""
    if specialized.learnt:
        return {
            "computed": "identified sample by sample\nwith the tires,",
            "learns": "learn, unless frozen",
        }
    tires = "\nby the tires of a fit," if specialized.method.whole else ""
    return {"computed": f"computed sample by sample{tires}", "learns": "hold"}


def _about_signals(specialized: SpecializedStep) -> dict[str, str]:
    """Return what the step reads and tells, and what is said of signals that may be missing."""
    name, absent = specialized.name, []
    signals = "v_x, v_y, r and steering"
    if specialized.reads_a_y:
        signals = "v_x, v_y, r, a_y and steering"
        absent.append(
            "`a_y` is what an accelerometer shows that is fixed to the body: what tires push, and\n"
            "a share of gravity where the body rolls. Where there is none it is NaN: no sample is\n"
            "refused for it."
        )
    if specialized.tells_v_y:
        signals = "v_x, r, a_y and steering"
        flagged = " Use it where\n`side_slip_observable` is 1, and as sure as `v_y_sd` says."
        absent.append(
            "`v_y` of the input is not read.\n"
            f"Its estimate is in `{name}_output`, which `{name}_get_output` "
            f"copies.{flagged if specialized.side_slip == SIDE_SLIP else ''} All of\nit is zero "
            "before the first sample, and where samples have been refused for too long."
        )
    return {
        "signals": signals,
        "tells": ", without v_y,\nwhich is an output" if specialized.tells_v_y else "",
        "absent": "".join(f"{sentence}\n\n" for sentence in absent),
    }


def _about_refused(specialized: SpecializedStep) -> dict[str, str]:
    """Return what becomes of forces while samples are refused, and of the state after it."""
    row = "| 2 `IMPLAUSIBLE` | no car can be there{} | {} | hold | yes |\n"
    if specialized.believed is not None:
        lasting = "of the last plausible sample, zero where that lasts"
        return {
            "implausible_row": row.format(", or get there within a sample", lasting),
            "refused_forces": lasting,
            "after_gap": "After a moment (0.25 s of a car) the step rests, and takes the next\n"
            "sample that a car can be in as true, however far from the last: status 0. A sensor\n"
            "that alternates between far values passes every second sample.",
        }
    return {
        "implausible_row": row.format("", "zero") * (specialized.parts.where_false is not None),
        "refused_forces": "as before",
        "after_gap": "With the next good sample observers and filters begin anew, and the "
        "weights stay.",
    }


def _table(signals: Sequence[Signal]) -> str:
    return "".join(f"| `{s.name}` | {s.unit} | {s.description} |\n" for s in signals)
