"""`tireid identify LOG --vehicle FILE --out DIR`: learn the tires of a recording, freeze them."""

import argparse
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from identifier.doctor import diagnose
from identifier.estimate.method import FitMethod
from identifier.frozen import FrozenModelError, require_alive
from identifier.method import CannotFreezeError, Method
from identifier.reproducibility import counted_samples, freeze_key
from identifier.run import History, check_recording
from models.recordings import Recording, Repair, check_against_vehicle, check_physics, joined
from models.vehicle import Vehicle
from tireid.commands import options as shared
from tireid.commands.certificate_table import verdict_line
from tireid.diagnoses import add_repair, doctor_text, with_doctor, write_repair
from tireid.identified import Results, file_name
from tireid.learning import identify
from tireid.output import require_free, write_json
from tireid.progress import Progress, say, tell
from tireid.reports.identify import side_slip_text, write_identify_report
from tireid.verdicts import sensors_text, verdict_text, verdicts_text

_LEARNING, _JUDGING, _DRAWING = "learning", "replays and verdict", "curves and figures"


def declare(new: Any) -> None:
    parser = new(
        description="Identify the axle forces of LOG, freeze the model, replay LOG and other "
        "recordings; write report.html, summary.json, weights.json, curves as CSV and figures.",
        epilog="LOG is a log of any format with the columns t [s], vx, vy [m/s], r [rad/s], "
        "delta_f [rad] and, where known, delta_r [rad], ay [m/s2], Fyf, Fyr [N] (or Fyf_inv, "
        "Fyr_inv: forces computed backwards from the motion), run; x forward, y left, delta and r "
        "positive to the left. --columns or --log give other names, units and signs; tireid "
        "channels LOG lists what is there. Several logs are used as one drive, in order.",
    )
    parser.add_argument(
        "logs", nargs="+", metavar="LOG", help="recording; LOG:RUN names one of its runs"
    )
    shared.add_vehicle(parser, required=True)
    shared.add_method(parser)
    several: dict[str, Any] = {"nargs": "+", "action": "extend"}
    text = "freeze at these times [s] (the end)"
    parser.add_argument("--freeze", type=float, metavar="T", help=text, **several)
    text = "validation drives to predict, each with a verdict"
    parser.add_argument("--replay", default=[], metavar="LOG[:RUN]", help=text, **several)
    flags = {
        "--each-day": "logs of different days: each has zeros of its sensors of its own (found "
        "where they clearly differ)"
    }
    shared.add_options(parser, bool, flags)
    shared.add_log_reading(parser)
    add_repair(parser, "identify the repaired log, and write the repair to")
    shared.add_weights(parser, "begin with this model")
    shared.add_seed(parser, "the initial weights of the paper's network")
    shared.add_accept(parser)
    shared.add_output(parser, "identify")


def run(options: argparse.Namespace) -> int:
    """Run the command; return 3 where what was learnt is not valid, or not of a replayed log."""
    vehicle = shared.read_vehicle(options)
    seed = None if options.seed is None else shared.seed_of(options)
    law, design = _method(options, vehicle, seed)
    start = shared.stored_model(options.weights)
    if options.repair is not None:
        require_free(options.repair, force=options.force)
    logs = [_read(log, vehicle, design, options) for log in options.logs]
    others = [_read(log, vehicle, design, options) for log in options.replay]
    every = [*logs, *others]
    _require_distinct(every)
    recording = joined(logs)
    for one in every:
        check_recording(one, design)
    if any(one.v_y is None for one in every):
        say(f"a log has no lateral velocity: {law} learns, and estimates it")
    say("the doctor looks at the log")
    diagnosis = diagnose(recording, vehicle)
    repair = diagnosis.repair if options.repair is not None else Repair()
    if repair:
        logs, others = ([repair.apply(one, vehicle)[0] for one in some] for some in (logs, others))
        recording = joined(logs)
        vehicle = repair.on(vehicle)
        law, design = _method(options, vehicle, seed)
    if options.repair is not None and not options.no_check:
        for one in (*logs, *others):
            check_physics(one)
            check_against_vehicle(one, vehicle)
    freeze_times = sorted(set(options.freeze or [float(recording.t[-1])]))
    _require_inside(freeze_times, recording)
    _require_model(law, design, vehicle)
    if start is not None and start.scales_with_load and not start.vehicle.moves_as(vehicle):
        say(f"{options.weights} is of the car {start.vehicle.name!r}: scaled by the axle loads")
    count = 1.0 + len(others)
    parts = {_LEARNING: count, _JUDGING: 0.1 * count, _DRAWING: 0.5 + 0.5 * count}  # about s
    with shared.folder_of(options) as folder:
        progress = Progress("identify", parts)
        runs: list[History] = []
        for k, one in enumerate((recording, *others)):
            if design.whole and runs:
                runs.append(runs[0].evaluated(one, freeze_times[-1]))
                continue
            share = progress.within(k / count, (k + 1) / count)
            runs.append(  # checked when they were read
                identify(one, vehicle, design, start=start, check=False, progress=share).history
            )
            say(f"learnt {law} over {one.name}")
        progress.begin(_JUDGING)
        learnt, last = runs[0], freeze_times[-1]
        for t in freeze_times:
            _require_tires(learnt, t)
        pieces = learnt.parts(logs) if len(logs) > 1 else []
        noted = partial(with_doctor, diagnosis=diagnosis, repair=repair)
        found = Results.learnt(law, runs, freeze_times, others, pieces, noted)
        verdict, replayed = found.verdict, found.evaluated
        figures = found.write(folder, progress.begin(_DRAWING))
        write_json(folder / "doctor.json", {**diagnosis.to_dict(), "applied": repair.tables()})
        log_map = shared.given_map(options)
        write_identify_report(folder, found, figures, diagnosis, options.words, log_map)
        said = (
            found.table(),
            _closing_line(learnt, last, vehicle),
            doctor_text(diagnosis, repair, options.repair),
            sensors_text(found.model, found.drives),
            verdicts_text(replayed, "replayed on"),
            verdict_text(verdict),
        )
    if repair:
        write_repair(options.repair, log_map, diagnosis)
        say(f"wrote {options.repair}")
    tell(*said)
    say(f"wrote {options.out}/")
    return max(shared.exit_code(one, options) for one in (verdict, *replayed.values()))


def _method(options: argparse.Namespace, vehicle: Vehicle, seed: int | None) -> tuple[str, Method]:
    law, design = shared.chosen_method(options, vehicle, seed)
    if not options.each_day:
        return law, design
    if not isinstance(design, FitMethod):
        raise ValueError(f"--each-day is of the method fit: {law} reads one log after the other")
    return law, replace(design, days="each")


def _require_model(law: str, design: Method, vehicle: Vehicle) -> None:
    """Refuse a filter of forces before it runs: there would be nothing to freeze."""
    if design.whole:
        return
    try:
        design.frozen(vehicle, design.setup(vehicle).carry)
    except CannotFreezeError as error:
        raise CannotFreezeError(f"--method {law}: {error}; tireid compare shows it") from None


def _require_tires(learnt: History, t: float) -> None:
    """Refuse what was learnt of a log that no tires made: it could not be read back."""
    try:
        tires = learnt.freeze(t)
        require_alive(FrozenModelError, tires.force, tires.vehicle)
    except FrozenModelError as error:
        raise FrozenModelError(
            f"{learnt.recording.name}: at {freeze_key(t)} s no tires were identified: {error}"
        ) from None


def _closing_line(learnt: History, t: float, vehicle: Vehicle) -> str:
    """Return the certificate of the paper's identifier, or what the axle identifier knows."""
    model, certificate = learnt.freeze(t), learnt.method.certify(vehicle)
    if model.known_slip is None and certificate.properties:
        return verdict_line(certificate)
    if model.known_slip is None:
        return "frozen; `tireid compare` sets it beside the other methods"
    known = np.degrees(model.known_slip)
    reach = f"known to {known[0]:.1f} / {known[1]:.1f} deg of slip (front / rear)"
    listed = (
        f"certificate: {certificate.verdict}; parameter limits: enforced (listed in summary.json)"
    )
    given = side_slip_text(learnt), reach, listed * learnt.online
    return "\n".join(one for one in given if one)


def _read(log: str, vehicle: Vehicle, design: Method, options: argparse.Namespace) -> Recording:
    check = options.repair is None  # else once it is repaired
    recording = shared.read_log(log, vehicle, options, check=check, dt=design.dt)
    counted_samples(recording, design.min_speed)  # refuses a car that never drives
    return recording


def _require_distinct(recordings: list[Recording]) -> None:
    files = [file_name(recording) for recording in recordings]
    for recording, name in zip(recordings, files, strict=True):
        if files.count(name) > 1:
            raise ValueError(
                f"{recording.name} is given twice, or its files would be named as those of another "
                f"recording, {name}: every recording needs a different name"
            )


def _require_inside(freeze_times: list[float], recording: Recording) -> None:
    first, last = float(recording.t[0]), float(recording.t[-1])
    for t in freeze_times:
        if not first <= t <= last:
            lasts = f"{recording.name} lasts from {freeze_key(first)} to {freeze_key(last)} s"
            raise ValueError(f"--freeze {freeze_key(t)} is outside the recording: {lasts}")
    for earlier, later in pairwise(map(freeze_key, freeze_times)):
        if earlier == later:
            raise ValueError(f"--freeze {later} is given twice: the times differ too little")
