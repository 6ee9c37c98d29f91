"""`tireid doctor LOG --vehicle FILE`: what is wrong with a log, and a log.toml that mends it."""

import argparse
from typing import Any

from identifier.doctor import diagnose
from models.recordings import Repair
from models.recordings.reader import repair_text
from tireid import __version__
from tireid.commands import DONE, NOT_VALID
from tireid.commands import options as shared
from tireid.diagnoses import (
    add_repair,
    diagnosis_text,
    unsure_text,
    write_doctor_report,
    write_repair,
)
from tireid.figures.forces import draw_diagnosis
from tireid.figures.style import save_figures
from tireid.output import require_free, write_json
from tireid.progress import say, tell
from tireid.report import READ, Picture
from tireid.reports.captions import diagnosis_caption


def declare(new: Any) -> None:
    parser = new(
        description="Find faults of LOG, or of its car as declared by --vehicle, in the log "
        "alone: units, signs, steering-wheel angle, offsets, delays, sensors at other places or "
        "angles, frozen or lost samples, another car. Exit code 3 where something was found "
        "that matters. --repair writes the log.toml with which other commands read it as it "
        "should be (--log FILE).",
    )
    parser.add_argument("log", metavar="LOG", help="recording; LOG:RUN names one of its runs")
    shared.add_vehicle(parser, required=True)
    shared.add_log_map(parser)
    add_repair(parser, "and write it to")
    shared.add_accept(parser)
    shared.add_output(parser, None)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 3 where something was found that matters."""
    if options.repair is not None:
        shared.require_toml(options.repair)
        require_free(options.repair, force=options.force)
    vehicle, log_map = shared.read_vehicle(options), shared.given_map(options)
    recording = shared.read_log(options.log, vehicle, options, check=False)
    say("the doctor looks at it")
    diagnosis = diagnose(recording, vehicle)
    repair = diagnosis.repair if options.repair is not None else Repair()
    repaired, car = repair.apply(recording, vehicle) if repair else (recording, vehicle)
    after = diagnose(repaired, car) if repair else None
    if options.out is not None:
        with shared.folder_of(options) as folder:
            figure = draw_diagnosis(recording, vehicle, repaired, car)
            images = save_figures(folder, {"slip": figure})
            left = None if after is None else after.to_dict()
            found = {**diagnosis.to_dict(), "applied": repair.tables(), "after": left}
            write_json(folder / "summary.json", {**found, "version": __version__})
            caption = diagnosis_caption(recording, vehicle, repaired, car)
            picture = Picture(images["slip"], caption, READ["doctor"])
            write_doctor_report(
                folder, recording, vehicle, diagnosis, after, picture, options.words
            )
    tell(diagnosis_text(diagnosis))
    if options.repair is not None:
        if after is None:
            tell(unsure_text(diagnosis, options.repair))
        else:
            tell(f"repaired: {repair_text(repair)}")
            tell(f"after the repair, {diagnosis_text(after, unobservable=False)}")
        write_repair(options.repair, log_map, diagnosis)
        say(f"wrote {options.repair}; read the log with --log {options.repair}")
    if options.out is not None:
        say(f"wrote {options.out}/")
    return DONE if (after or diagnosis).healthy or options.accept else NOT_VALID
