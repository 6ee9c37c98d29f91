"""What another distribution adds: a tire and an exporter, each by a file and one line."""

import sys

import numpy as np
import pytest

import tireid as ti
from models.maneuvers import Slalom
from models.plant import Plant
from models.tires import LinearTire
from tests.tireid.conftest import typed
from tireid.cli import build_parser

CAR = ti.sedan()
POINTS = """[tireid.commands]
points = their_command
absent = their_absent
"""
TIRE = """import casadi as ca
from dataclasses import dataclass
from models.tires import TireForces

@dataclass(frozen=True)
class Saturating:
    stiffness: float

    def forces(self, alpha, kappa, gamma, F_z, mu=1.0):
        peak = mu * ca.fmax(F_z, 1.0)
        return TireForces(peak * ca.tanh(self.stiffness * kappa / peak),
                          peak * ca.tanh(self.stiffness * alpha / peak))

    def slip_stiffness(self, F_z):
        return self.stiffness

    cornering_stiffness = slip_stiffness
"""
COMMAND = '''"""The curves of a model as points."""
from pathlib import Path
import numpy as np
from identifier.tire_model import load_model

def add_parser(commands):
    parser = commands.add_parser("points", help="points")
    parser.add_argument("model")
    parser.add_argument("out", type=Path)
    parser.set_defaults(run=run)

def run(options):
    slip = np.linspace(-0.1, 0.1, 21)
    force = load_model(options.model).force(slip)
    np.savetxt(options.out, np.column_stack([slip, force]), delimiter=",")
'''


@pytest.fixture(autouse=True)
def installed(distribution):
    distribution(POINTS, their_tire=TIRE, their_command=COMMAND)


def test_a_tire_is_an_object_that_the_plant_takes():
    from their_tire import Saturating

    steering = Slalom(amplitude=0.003, frequency=0.5, onset=0.5, rate_limit=0.1, duration=3.0)
    theirs, linear = (
        Plant(CAR, tire).simulate(steering, speed=20.0).recording()
        for tire in (Saturating(6e4), LinearTire(C_alpha=6e4, C_kappa=6e4))
    )
    moved = np.abs(linear.r).max()
    assert 1e-4 * moved < np.abs(theirs.r - linear.r).max() < 0.03 * moved  # gentle: nearly linear


def test_an_exporter_is_a_command_that_reads_a_model(tmp_path):
    run = ti.identify(ti.sample_recording(CAR), CAR, "linear", check=False)
    tire = run.freeze()
    tire.save(tmp_path / "model.json")
    assert typed("points", tmp_path / "model.json", tmp_path / "points.csv") == 0
    points = np.loadtxt(tmp_path / "points.csv", delimiter=",")
    np.testing.assert_allclose(points[:, 1:], tire.force(points[:, 0]), rtol=1e-12)
    listed = build_parser([]).format_help()
    assert "the curves of a model as points" in listed
    assert "their_command" in sys.modules


def test_a_command_is_the_first_word_whatever_its_arguments_are_called():
    for words in (["fleet", "merge", "demo"], ["fleet", "merge", "store", "--out", "plan"]):
        assert build_parser(words).parse_args(words).command == "fleet"


def test_the_list_of_commands_imports_none_and_says_which_is_broken(capsys):
    before = set(sys.modules)
    listed = " ".join(build_parser([]).format_help().split())
    assert "points the curves of a model as points" in listed and "fleet" in listed
    assert "absent cannot be imported" in listed
    assert not [name for name in set(sys.modules) - before if name.startswith(("their", "tireid."))]
    assert typed("absent") == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "command absent (their_absent) cannot be imported: No module named" in line
