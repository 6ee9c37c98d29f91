"""A case: a door, mutations and what lies around, drawn by seed and number, put in a folder."""

import random
import shutil
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import NamedTuple

from benchmarks.fuzz.doors import DOORS, WORDS, Door
from benchmarks.fuzz.raw import bytes_mutated, other_kind
from benchmarks.fuzz.tables import csv_mutated, gz_mutated, parquet_mutated, tir_mutated
from benchmarks.fuzz.trees import json_mutated, toml_mutated
from benchmarks.fuzz.words import words_mutated
from tireid.output import output_folder

MUTATORS: Mapping[str, Callable[[random.Random, bytes], bytes]] = {
    "csv": csv_mutated,
    "gz": gz_mutated,
    "parquet": parquet_mutated,
    "mat": bytes_mutated,
    "toml": toml_mutated,
    "json": json_mutated,
    "tir": tir_mutated,
}
MOST = 3  # mutations of a case
NOTES = {"notes.txt": b"of the user\n", "data/run.csv": b"1,2,3\n"}  # which no command was told of
AROUND = ("none", "empty", "theirs", "ours", "ours and theirs", "file", "link")
LARGEST = 50_000_000  # bytes of a file


class Case(NamedTuple):
    """What is tried.

    Parameters
    ----------
    number : of the case, from which with the seed all follows.
    seed : of the run.
    door : the command.
    steps : indices of the mutations that are made; fewer of them are a smaller case.
    around : what has the name of the folder to write already.
    drawn : whether figures are drawn as in life; else they are made, but not put on paper.
    """

    number: int
    seed: int
    door: Door
    steps: tuple[int, ...]
    around: str
    drawn: bool


def draw(seed: int, number: int, doors: Collection[Door] = DOORS) -> Case:
    """Return a case.

    Parameters
    ----------
    seed : of the run.
    number : of the case.
    doors : to draw from.
    """
    rng = random.Random(f"{seed}/{number}")
    doors = list(doors)
    door = rng.choices(doors, [door.share for door in doors])[0]
    count = rng.choices(range(1, MOST + 1), (7, 2, 1))[0]
    around = rng.choices(AROUND, (16, 1, 1, 1, 1, 1, 1))[0]
    return Case(number, seed, door, tuple(range(count)), around, drawn=rng.random() < 0.1)


def lay_out(case: Case, seeds: Mapping[str, bytes], folder: Path) -> list[str]:
    """Write the files of a case into an empty folder; return the words of the command.

    Parameters
    ----------
    case : what is tried; no steps: the door as it should be.
    seeds : files that are right.
    folder : the working folder of the command.
    """
    files = {name: seeds[name] for name in case.door.files}
    words = list(case.door.words)
    odd: list[tuple[random.Random, str]] = []
    for step in case.steps:
        rng = random.Random(f"{case.seed}/{case.number}/{step}")
        target = rng.choice(case.door.mutated)
        if target == WORDS:
            words = words_mutated(rng, words)
        elif rng.random() < 0.03:
            odd.append((rng, target))
        else:
            changed = MUTATORS[target.rpartition(".")[2]](rng, files[target])
            files[target] = changed[:LARGEST]
    for name, content in {**files, **NOTES}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    for rng, target in odd:
        other_kind(rng, folder / target)
    if case.steps and case.around != "none":
        _surround(folder, case.around)
        if random.Random(f"{case.seed}/{case.number}/force").random() < 0.5:
            words.append("--force")
    return words


def _surround(folder: Path, kind: str) -> None:
    """Put something where the command is to write."""
    out = folder / "out"
    if kind.startswith("ours"):
        with output_folder(out, force=False) as new:
            (new / "summary.json").write_text("{}\n", encoding="utf-8")
            (new / "deep").mkdir()
            (new / "deep" / "old.csv").write_text("1\n", encoding="utf-8")
        if kind.endswith("theirs"):
            (out / "deep" / "mine.txt").write_text("of the user\n", encoding="utf-8")
    elif kind == "file":
        out.write_text("of the user\n", encoding="utf-8")
    elif kind == "link":
        out.symlink_to("data")
    else:
        out.mkdir()
        if kind == "theirs":
            (out / "mine.txt").write_text("of the user\n", encoding="utf-8")


def clear(folder: Path) -> Path:
    """Return a folder that is empty.

    Parameters
    ----------
    folder : deleted with all that is in it.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
