"""The sources inside an FMU: they count samples right, keep to the standard, and build anew."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from codegen import find_compiler
from identifier.export.fmu import OF_VERSION, SHARED, fmu_text
from identifier.export.specialize import specialize
from identifier.paper.design import PaperIdentifier
from models.vehicle import sedan

CAR = sedan()
COMPILER = find_compiler()
pytestmark = pytest.mark.skipif(COMPILER is None, reason="needs a C compiler")
COMPONENT = ("tireid.c", "tireid_equations.c")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion")

# Plays the master: communication steps of h microseconds, time once added up and once multiplied.
# After each step the number of samples must be that of integer arithmetic. A counter that divides
# times and drops the fraction stands beside it, to show that the task is not trivial.
CLOCK = r"""
#include <stdio.h>
#include "fmi2Functions.h"
#include "model.h"
int main(void) {
  static const long long STEPS[] = {1000, 2500, 7000, 10000, 40000};
  static const unsigned int INPUTS[] = {1, 2, 3, 4, 5}, SAMPLES[] = {9};
  const double input[] = {20.0, 0.2, 0.1, 0.02, 0.0};
  fmi2CallbackFunctions none = {0};
  int i, way;
  for (i = 0; i < 5; ++i)
    for (way = 0; way < 2; ++way) {
      const long long h = STEPS[i], n = 1000000000LL / h;
      long long k, wrong = 0, naive_wrong = 0;
      int samples = 0;
      double t = 0.0;
      fmi2Component c = fmi2Instantiate("one", fmi2CoSimulation, MODEL_TOKEN, "", &none, 0, 0);
      fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0);
      fmi2EnterInitializationMode(c);
      fmi2ExitInitializationMode(c);
      fmi2SetReal(c, INPUTS, 5, input);
      for (k = 0; k < n; ++k) {
        if (way == 1) t = (double)(k * h) / 1e6;
        fmi2DoStep(c, t, (double)h / 1e6, 1);
        if (way == 0) t += (double)h / 1e6;
        fmi2GetInteger(c, SAMPLES, 1, &samples);
        wrong += samples != ((k + 1) * h + 9999) / 10000;
        naive_wrong += (long long)((double)((k + 1) * h) / 1e6 / 0.01) != (k + 1) * h / 10000;
      }
      fmi2FreeInstance(c);
      printf("%lld %d %d %lld %lld\n", h, way, samples, wrong, naive_wrong);
    }
  return 0;
}
"""


def write_sources(folder, version):
    text = fmu_text(specialize(PaperIdentifier.for_vehicle(CAR), CAR), version)
    for name, content in text.items():
        if name.startswith("sources/"):
            (folder / Path(name).name).write_text(content)


def compiled(folder, *arguments):
    return subprocess.run(
        [*COMPILER, "-std=c99", "-ffp-contract=off", *arguments], cwd=folder, capture_output=True,
        text=True, check=False,
    )  # fmt: skip


def test_no_sample_is_missed_or_doubled_in_1000_s(tmp_path):
    write_sources(tmp_path, 2)
    (tmp_path / "clock.c").write_text(CLOCK)
    answer = compiled(
        tmp_path, "-O1", "clock.c", "fmi.c", "memory.c", *COMPONENT, "-lm", "-o", "clock"
    )
    assert answer.returncode == 0, answer.stderr
    told = subprocess.run([tmp_path / "clock"], capture_output=True, text=True, check=True).stdout
    table = np.array([line.split() for line in told.splitlines()], dtype=int)
    assert table[:, 0].tolist() == [h for h in (1000, 2500, 7000, 10000, 40000) for _ in range(2)]
    last = 1_000_000_000 // table[:, 0] * table[:, 0]
    assert (table[:, 2] == -(-last // 10000)).all()
    assert (table[:, 3] == 0).all()
    assert (table[:, 4] > 0).any()  # dividing times goes wrong


@pytest.mark.parametrize("version", [2, 3])
def test_declarations_agree_with_those_of_the_standard(tmp_path, version):
    fmpy = pytest.importorskip("fmpy", reason="needs the header files in the package fmpy")
    headers = Path(fmpy.__file__).parent / "c-code"
    write_sources(tmp_path, version)
    ours = tmp_path / f"fmi{version}Functions.h"
    declared = re.findall(rf"\b(fmi{version}\w+) fmi{version}FullName", ours.read_text())
    ours.unlink()
    files = [name for name in OF_VERSION[version] if name.endswith(".c")]
    answer = compiled(tmp_path, "-Werror", f"-I{headers}", "-fPIC", "-shared", *files, "-o", "x.so")
    assert answer.returncode == 0, answer.stderr
    known = re.findall(
        rf"\b(fmi{version}\w+)\s+fmi{version}FullName",
        (headers / f"fmi{version}Functions.h").read_text(),
    )
    if version == 3:  # which wants all functions of every FMU
        assert set(declared) == set(known)
    assert set(declared) <= set(known)
    assert len(declared) > 30


@pytest.mark.parametrize("version", [2, 3])
def test_a_wrong_declaration_would_be_noticed(tmp_path, version):
    fmpy = pytest.importorskip("fmpy", reason="needs the header files in the package fmpy")
    write_sources(tmp_path, version)
    (tmp_path / f"fmi{version}Functions.h").unlink()
    file = tmp_path / "fmi.c"
    right = file.read_text()
    file.write_text(
        re.sub(
            r"(?<=\()(fmi\d\w+) c, fmi\d(Real|Float64) currentComm", r"\1 c, int currentComm", right
        )
    )
    assert file.read_text() != right
    headers = Path(fmpy.__file__).parent / "c-code"
    answer = compiled(tmp_path, f"-I{headers}", "-c", file.name)
    assert "conflicting types" in answer.stderr


@pytest.mark.parametrize("version", [2, 3])
def test_our_sources_give_no_warning(tmp_path, version):
    write_sources(tmp_path, version)
    files = [name for name in (*SHARED, *OF_VERSION[version], *COMPONENT) if name.endswith(".c")]
    answer = compiled(tmp_path, *STRICT, "-Werror", "-fsyntax-only", *files)
    assert answer.returncode == 0, answer.stderr


def test_functions_take_a_prefix_where_several_are_linked(tmp_path):
    write_sources(tmp_path, 2)
    answer = compiled(tmp_path, "-DFMI2_FUNCTION_PREFIX=tireid_", "-c", "fmi.c", "-o", "fmi.o")
    assert answer.returncode == 0, answer.stderr
    assert b"tireid_fmi2DoStep" in (tmp_path / "fmi.o").read_bytes()


def test_fast_math_is_refused(tmp_path):
    write_sources(tmp_path, 2)
    answer = compiled(tmp_path, "-Ofast", "-c", "memory.c")
    assert "guards against NaN" in answer.stderr
