"""The name of a car is words in all that is exported: nothing in it is ever run."""

import json
import re
import subprocess
from dataclasses import replace
from shutil import which

import pytest

from identifier.methods import make_method
from models.vehicle import sedan
from tests.tireid.conftest import json_of, typed
from tireid.emitting import emit

ORDER = "x\nexecute_process(COMMAND ${CMAKE_COMMAND} -E touch ran)\n#"
CONSTRUCTOR = (
    "*/ #include <stdio.h>\n__attribute__((constructor)) static void run(void)\n"
    '{ fopen("ran", "w"); }\n/*'
)
NAMES = {
    "an order to cmake": ORDER,
    "a constructor": CONSTRUCTOR,
    "keys": "@title@ me@home@x @numbers@ @version_text@",
    "a trigraph": "??/\n*??/\n/ int x; /*",
    "signs": "\x1b[2J\x1b]0;owned\x07\u202e*/ int x; /*\u2066",
    "generator": "$<1:x> ${HOME} $ENV{HOME} [[ ]]",
    "markup": "<script>alert(1)</script> | `id` [x](y) & $x^$",
}


pytestmark = pytest.mark.usefixtures("unmeasured")


def car_called(name, folder):
    """A car file; JSON's escapes are those of TOML."""
    sedan().to_toml(folder / "sedan.toml", overwrite=True)
    text = (folder / "sedan.toml").read_text()
    quoted = json.dumps(name).replace("\x7f", "\\u007f")
    file = folder / "car.toml"
    file.write_text(re.sub("^name = .*$", lambda _: f"name = {quoted}", text, flags=re.M))
    return file


def built(folder, *options):
    """Configure and build a package with its tests, and run them."""
    for words in (
        ["cmake", "-S", ".", "-B", "build", *options],
        ["cmake", "--build", "build"],
        ["ctest", "--test-dir", "build"],
    ):
        answer = subprocess.run(words, cwd=folder, capture_output=True, text=True)
        assert answer.returncode == 0, answer.stdout + answer.stderr


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_name_is_a_comment_in_what_other_tools_read(name, tmp_path):
    for car in (sedan(), replace(sedan(), name=name)):
        method = make_method("axle", car)
        model = method.frozen(car, method.setup(car).carry)
        emit(model, tir=tmp_path / "car.tir", overwrite=True)
        lines = (tmp_path / "car_front.tir").read_text(encoding="utf-8").splitlines()
        comments = [line.startswith("$") for line in lines]
        assert comments == sorted(comments, reverse=True) and 0 < sum(comments) < len(lines)


@pytest.mark.sweep("an order to cmake")
@pytest.mark.skipif(which("cmake") is None, reason="needs cmake")
@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_package_is_built_and_nothing_else_is_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "out"
    assert typed("export", "--out", out, "--vehicle", car_called(name, tmp_path)) == 0
    built(out, "-DCMAKE_C_FLAGS=-Wall -Wextra -Werror -trigraphs")
    assert not list(tmp_path.rglob("ran"))
    assert json_of(out / "tireid.json")["vehicle"]["name"] == name
    for file in out.rglob("*.*"):
        if file.suffix in (".c", ".h", ".md", ".txt"):
            text = file.read_text(encoding="utf-8")
            assert text.replace("\n", "").isprintable(), file


def test_no_name_and_no_word_commands_the_terminal(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bell = "\x1b[2J\x1b]0;owned\x07\x9b2J"
    car = car_called(bell, tmp_path)
    log = tmp_path / f"log{bell}.csv"
    log.write_text(f"t,vx{bell}\n0,1\n")
    assert typed("check", "--vehicle", car) in (0, 1)
    assert typed("check", "--design", tmp_path / f"no{bell}.toml") == 2
    assert typed("identify", log, "--vehicle", car, "--out", "out") == 2
    assert typed("--debug", "identify", log, "--vehicle", car, "--out", "out") == 2
    with pytest.raises(SystemExit):
        typed("check", f"--{bell}")
    said = capsys.readouterr()
    assert "owned" in said.out
    assert "owned" in said.err
    for text in said:
        assert text.replace("\n", "").isprintable()
