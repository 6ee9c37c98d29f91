"""`tireid channels LOG [--write log.toml]`: what a log holds, and how it would be read."""

import argparse
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from codegen.escape import visible
from models.files import write_atomically
from models.logs.clock import holes, without_codes, without_empty
from models.logs.log import Channel, Listed, LogFile, RecordingError, one_run, some
from models.logs.names import Proposal, is_commanded, propose
from models.logs.signals import (
    INSTEAD,
    MEANINGS,
    NEEDED,
    POSE,
    QUANTITIES,
    WHEELS,
    Signal,
    given_by,
    quantity_of,
)
from models.logs.units import SI, is_given, to_si
from models.recordings import LogMap, choice, split_log_argument
from models.recordings.assembly import require_often, units_of, wheel_scales
from models.recordings.choice import column_of
from models.recordings.map import CUT
from models.recordings.wheels import scale_text, wheel_factor, with_scales
from tireid.commands import DONE, FAILS
from tireid.commands.options import add_force, add_log_map, given_map, require_toml
from tireid.output import require_free, text_table
from tireid.progress import say, tell

_CUT_BY_MAP = "rejected without --cut-holes or a map with that key, as of --write"
_MOST_NUMBERS = 5e7  # that are read for ranges; of a larger log only those of likely channels
_LONGEST_NAME = 48  # letters of a channel in the table
_Signals = Mapping[str, Signal]
_OF_POSE = ("v_x", "v_y", "r")
_COMMANDED = ", commanded and not measured"
_NO_RADIUS = "\n# [wheels]\n# radius =   # by which a wheel rolls [m]\n"


def declare(new: Any) -> None:
    parser = new(
        description="List the channels of LOG with unit, rate, samples and range, and what each "
        "probably is; say what is missing. --write FILE writes the log.toml by which every command "
        "reads such logs (--log FILE). Exit code 1 where something is missing or not sure.",
    )
    parser.add_argument("log", metavar="LOG", help="a log; LOG:RUN names one of its runs")
    add_log_map(parser)
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the map, .toml")
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 1 where a signal that is needed is missing or not sure."""
    path, named = split_log_argument(options.log)
    log_map = given_map(options)
    if options.write is not None:
        require_toml(options.write)
        require_free(options.write, force=options.force)
    log = log_map.opened(path)
    wanted, runs = named or log_map.run, log.runs()
    chosen = one_run(log.path, runs if wanted else runs[:1], wanted or None)
    listed = log.listed()
    headings, turned, world = choice.of_the_car(log, log.headings(), chosen)
    proposal = propose(log, headings, chosen)
    by_map = choice.as_listed(log, log_map.signals, [one.name for one in listed])
    for name, unit in units_of(log.headings(), by_map).items():
        to_si(unit, quantity_of(name, unit), f"{log.path}: {column_of(name)}")
    sure = {**choice.standard_signals(log, [one.name for one in headings]), **turned, **by_map}
    signals = choice.likely_signals(sure, proposal)
    signals = choice.with_wheels(signals, proposal)
    hand, given = proposal.guesses.get("delta_f"), signals.get("delta_f")
    if (
        hand
        and hand.hand
        and given
        and given == replace(given, channel=hand.channel, ratio=1.0, table=())
    ):
        del signals["delta_f"]  # declared without the ratio that it wants
    if _is_posed(signals) and not choice.has_wheels(signals):
        signals = {n: one for n, one in signals.items() if n not in ("v_x", "v_y")}  # not used
    missing = choice.missing_signals(signals)
    tell(*_head(log, chosen))
    coded = {name: without_codes(one) for name, one in _seen(log, listed, signals, chosen).items()}
    seen = {name: one for name, (one, _) in coded.items()}
    tell(_channels_text(listed, seen, signals, proposal, frozenset(sure)), world)
    for name, (_, codes) in coded.items():
        if codes:
            tell(f"{visible(name)} is {codes} where it has no value: left out")
    empty = _holes_text(seen, signals)
    if empty:
        cut = "cut out, as given" if log_map.holes == CUT else _CUT_BY_MAP
        tell(f"{empty}: they are {cut}")
        log_map = replace(log_map, holes=CUT)
    left, aside = ("", []) if "v_y" in missing else choice.aside(signals, proposal)
    if aside:
        tell(left)
    elif not choice.has_v_y(signals) and not missing:
        tell(f"{column_of('a_y')} is there: without vy, identify estimates it")
    said, of_wheels, rolls = _wheels(log, signals, log_map, chosen)
    if not missing:
        for name in {channel for one in signals.values() for channel in one.channel} & set(seen):
            require_often(str(log.path), without_empty(seen[name]).t, log.clock)
    if rolls or missing:
        tell(_missing_text(options, missing, proposal, signals))
    if said:
        tell(said)
    if options.write is not None:
        behind = [*missing, *aside]
        text = of_wheels.toml(options.write.parent)
        text += _unsure_toml(behind, proposal) + ("" if rolls else _NO_RADIUS)
        write_atomically(options.write, text)
        say(f"wrote {options.write}" + (": what is missing stands behind # in it" * bool(behind)))
    return DONE if rolls and not missing else FAILS


def _is_posed(signals: _Signals) -> bool:
    """Return whether a pose is read, of which v_x, v_y and r are made."""
    return set(POSE) <= set(signals)


def _wheels(
    log: LogFile, signals: _Signals, log_map: LogMap, run: str | None
) -> tuple[str, LogMap, bool]:
    """Return what is said of wheels, the map with what is learnt, and whether v_x is known."""
    plain = replace(log_map, signals=signals)
    if not choice.has_wheels(signals):
        return "", plain, True
    if "v_x" in signals:
        try:
            scales = wheel_scales(log, signals, log_map, run)
        except RecordingError as error:
            kept = replace(plain, signals={n: one for n, one in signals.items() if n not in WHEELS})
            return f"the wheels are not used: {error}", kept, True
        wheels, scaled = with_scales(log_map.wheels, signals, scales)
        return scale_text(scales), replace(log_map, wheels=wheels, signals=scaled), True
    try:
        for name, unit in units_of(log.headings(), signals).items():
            if name in WHEELS:
                wheel_factor(column_of(name), name, unit, log_map.wheels)
    except RecordingError as error:
        return str(error), plain, False
    return "vx is computed from the wheels", plain, True


def _head(log: LogFile, run: str | None) -> list[str]:
    runs = log.runs()
    lines = [f"{log.path}: {log.format}", *(f"  {word}" for word in log.dialect)]
    lines += [f"  {note}" for note in log.notes]
    if len(runs) > 1:
        lines.append(f"  {len(runs)} runs: {some(runs)}; what follows is of {run}")
    return lines


def _seen(
    log: LogFile, listed: Sequence[Listed], signals: _Signals, run: str | None
) -> dict[str, Channel]:
    names = [one.name for one in listed]
    if sum(one.samples for one in listed) > _MOST_NUMBERS:
        likely = {channel for signal in signals.values() for channel in signal.channel}
        names = [name for name in names if name in likely]
    return dict(zip(names, log.read(names, run), strict=True)) if names else {}


def _channels_text(
    listed: Sequence[Listed],
    seen: Mapping[str, Channel],
    signals: _Signals,
    proposal: Proposal,
    known: frozenset[str],
) -> str:
    rows = [["channel", "unit", "Hz", "samples", "from", "to", "is"]]
    for one in listed:
        channel = seen.get(one.name)
        low = high = "?"
        samples = one.samples
        if channel is not None:
            finite = channel.values[np.isfinite(channel.values)]
            samples = int(np.count_nonzero(~np.isnan(channel.values)))
            low, high = (f"{end:.4g}" for end in (finite.min(), finite.max())) if finite.size else (
                "empty", "")  # fmt: skip
        name = visible(one.name if len(one.name) <= _LONGEST_NAME else f"{one.name[:44]}...")
        rate = "?" if math.isnan(one.rate) else f"{one.rate:.4g}"
        meant = _meaning(one, signals, proposal, known)
        if low == high != "?" and meant.startswith("perhaps"):
            meant = f"constant {low}"
        rows.append([name, visible(one.unit), rate, str(samples), low, high, meant])
    return text_table(rows, "<<>>>><")


def _meaning(listed: Listed, signals: _Signals, proposal: Proposal, known: frozenset[str]) -> str:
    """Return what a channel is taken for, or may be, in which unit where the file gives none."""
    channel = listed.name
    for name, signal in signals.items():
        if channel in signal.channel:
            guess = proposal.guesses.get(name)
            remark = ""
            if guess is not None and name not in known and guess.confidence < 1.0:
                remark = f" ({guess.confidence:.0%})"
            remark += ", its sign turned" if signal.factor < 0.0 and name not in known else ""
            remark += f", its sign in {visible(signal.sign)}" if signal.sign else ""
            remark += _COMMANDED * is_commanded(channel)
            among = f", with {len(signal.channel) - 1} more" if len(signal.channel) > 1 else ""
            return f"{column_of(name)}: {MEANINGS[name]}{remark}{among}"
    for name, guess in proposal.guesses.items():
        for one in (guess, *proposal.rivals.get(name, ())):
            if channel in one.channel and INSTEAD.get(name) in signals:
                return f"{column_of(name)}, not read beside {column_of(INSTEAD[name])}"
            if channel in one.channel and name in _OF_POSE and _is_posed(signals):
                return f"{column_of(name)}, not read: it is from the pose"
            if channel in one.channel and name not in signals:
                unit = f" in {one.unit}" if one.unit and not is_given(listed.unit) else ""
                hand = ", of the hand wheel: give its ratio" if one.hand else ""
                hand += _COMMANDED * is_commanded(channel)
                doubt = "; another is as likely" if name in proposal.rivals else ""
                return f"perhaps {column_of(name)}{unit} ({one.confidence:.0%}){hand}{doubt}"
    return ""


def _holes_text(seen: Mapping[str, Channel], signals: _Signals) -> str:
    said = []
    for name, signal in signals.items():
        for channel in (seen[one] for one in signal.channel if one in seen):
            empty = holes(channel)
            if empty.size:
                first = f"{channel.place} {channel.rows[empty[0]]}"
                said.append(
                    f"{column_of(name)} has no value in {empty.size} of "
                    f"{channel.values.size} cells of {channel.name!r}, the first in {first}"
                )
    return "\n".join(said)


def _missing_text(
    options: argparse.Namespace, missing: Sequence[str], proposal: Proposal, signals: _Signals
) -> str:
    if not missing:
        there = given_by(signals)
        needed = [name for name in NEEDED if name in there] + ["a_y"] * ("v_y" not in there)
        posed = [column_of(name) for name in _OF_POSE if name not in signals]
        pose = f"; {', '.join(posed)} from the pose" * _is_posed(signals)
        return f"all that is needed is there: {', '.join(map(column_of, needed))}{pose}"
    lines, words = list[str](), list[str]()
    for name in missing:
        likely = choice.stand_ins(name, proposal)
        texts = " or ".join(choice.likely_text(one, proposal) for one in likely)
        instead = ", ay can replace it" if likely == ["a_y"] and name != "a_y" else ""
        lines.append(
            f"{column_of(name)} ({MEANINGS[name]}) is {'missing' if instead else 'not sure'}"
            f"{instead}: {texts}"
            if likely
            else f"{column_of(name)} ({MEANINGS[name]}) is missing"
        )
        proposed = [choice.column_word(one, proposal) for one in likely]
        words += proposed or [f'"{column_of(name)}=CHANNEL"']
    typed: str = options.words
    for pair in options.columns:
        if any(word.startswith(f'"{pair.partition("=")[0]}=') for word in words):
            typed = typed.replace(f" {shlex.quote(pair)}", "", 1)
    new = " ".join([" --columns", *words])
    typed += " --force" * (options.write is not None and not options.force)  # it is written now
    typed = typed.replace(" --columns", new, 1) if " --columns" in typed else typed + new
    return "\n".join([*lines, f"declare it: {typed}"])


def _unsure_toml(missing: Sequence[str], proposal: Proposal) -> str:
    """Return the tables of what is missing as comments, to be completed."""
    blocks = []
    for name in (one for lack in missing for one in choice.stand_ins(lack, proposal) or [lack]):
        guess = proposal.guesses.get(name)
        names = ("",) if guess is None else guess.channel
        channel = repr(names[0] if len(names) == 1 else list(names))
        ratio = ["# ratio =   # of the steering: hand wheel over road wheels"]
        wants_ratio = guess is not None and guess.hand
        unit = "" if guess is None else guess.unit or SI[QUANTITIES[name]]
        blocks += ["", f"# [signals.{name}]", f"# channel = {channel}   # {MEANINGS[name]}"]
        blocks += [f"# unit = {unit!r}", *(ratio if wants_ratio else [])]
    return "".join(f"{line}\n" for line in blocks)
