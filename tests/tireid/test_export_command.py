"""`tireid export`: a package that compiles without a warning and passes its own test."""

import json
import shutil
import subprocess

import pytest

from tireid.cli import main

STRICT = [
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Wdouble-promotion",
    "-Werror",
]
COMPILERS = [
    pytest.param(name, marks=pytest.mark.skipif(shutil.which(name) is None, reason=f"needs {name}"))
    for name in ("gcc", "clang")
]


@pytest.fixture(scope="module", params=["axle", "integral"])
def package(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export") / "package"
    assert main(["export", str(folder), "--law", request.param]) == 0
    return folder


def build(package, compiler, folder, *more):
    """Compile the library and its self-test; return the finished process."""
    sources = [*package.glob("src/*.c"), *package.glob("tests/*.c")]
    command = [compiler, *STRICT, *more, f"-I{package}/include", f"-I{package}/src"]
    command += [f"-I{package}/tests", *map(str, sources), "-o", str(folder / "test"), "-lm"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("precision", [[], ["-DTIREID_SINGLE"]])
def test_package_compiles_without_a_warning_and_passes_its_test(
    package, tmp_path, compiler, precision
):
    built = build(package, compiler, tmp_path, *precision)
    assert built.returncode == 0, built.stderr
    assert built.stderr == ""
    assert subprocess.run([tmp_path / "test"], check=False, capture_output=True).returncode == 0


def test_the_self_test_rings_where_a_number_is_wrong(package, tmp_path):
    spoilt = tmp_path / "spoilt"
    shutil.copytree(package, spoilt)
    vectors = next(spoilt.glob("tests/*.h"))
    text = vectors.read_text()
    digits = [k for k, letter in enumerate(text) if letter in "123456789"]
    k = digits[len(digits) * 9 // 10]
    while text[k - 1] not in " -{":  # the leading digit of a number
        k -= 1
    vectors.write_text(text[:k] + ("7" if text[k] != "7" else "3") + text[k + 1 :])
    built = build(spoilt, "gcc", tmp_path)
    assert built.returncode == 0, built.stderr
    assert subprocess.run([tmp_path / "test"], check=False, capture_output=True).returncode != 0


def test_fast_math_is_refused(package, tmp_path):
    built = build(package, "gcc", tmp_path, "-Ofast")
    assert built.returncode != 0
    assert "error" in built.stderr


def test_only_prefixed_symbols_and_no_allocation(package, tmp_path):
    for source in package.glob("src/*.c"):
        target = tmp_path / f"{source.stem}.o"
        include = [f"-I{package}/include", f"-I{package}/src"]
        subprocess.run(["gcc", *STRICT, *include, "-c", source, "-o", target], check=True)
        listed = subprocess.run(["nm", target], capture_output=True, text=True, check=True).stdout
        for line in listed.splitlines():
            kind, name = line.split()[-2:]
            if kind in "TDBRC":
                assert name.startswith("tireid_")
            if kind == "U":
                assert name.startswith("tireid_") or name in ("memcpy", "memset", "sqrt", "sqrtf")


def test_the_same_input_gives_the_same_bytes(package, tmp_path):
    law = json.loads((package / "tireid.json").read_text())
    again = tmp_path / "again"
    name = "integral" if "integral" in json.dumps(law) else "axle"
    assert main(["export", str(again), "--law", name]) == 0
    for path in package.rglob("*"):
        if path.is_file() and path.suffix in (".c", ".h", ".txt"):
            assert path.read_bytes() == (again / path.relative_to(package)).read_bytes()


def test_fmu_and_onnx_come_along(tmp_path):
    pytest.importorskip("onnx")
    assert main(["export", str(tmp_path / "out"), "--paper", "--fmu", "--onnx"]) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"tireid_fmi2.fmu", "tireid_fmi3.fmu", "tireid.onnx", "README.md"} <= names
