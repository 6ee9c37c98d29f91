"""What pages show is run: README's example learns the tire, and what fails is named by its line."""

import contextlib
import re
import signal

import numpy as np
import pytest

import tireid as ti
from docs.snippets import ROOT, SnippetError, parts, run_page


def page(folder, text):
    path = folder / "page.md"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_example_of_the_readme_identifies_the_tire(tmp_path):
    """On another drive the model error is below 8 % of either force."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    code = next(code for kind, code, _ in parts(text) if kind == "python").lstrip("\n")
    assert len(code.splitlines()) <= 12
    assert set(re.findall(r"^(?:import|from) (.*)", code, re.M)) == {"tireid as ti"}
    names = run_page(page(tmp_path, f"```python\n{code}```\n"), tmp_path).names
    tire, log = names["run"].tire, names["log"]
    assert names["run"].verdict.lines
    other = ti.replay(ti.sample_recording(names["car"], seed=1), tire)
    error, force = other.against_truth, other.true_force
    assert 0.0 < error.front < 0.08 * force.front and 0.0 < error.rear < 0.08 * force.rear
    loaded = ti.TireModel.load(tmp_path / "tire.json")
    assert np.array_equal(loaded.predict(log), tire.predict(log))
    assert 0.5 < tire.force(0.05, "front") / (0.05 * names["car"].cornering_stiffness_front) < 1.0


SHOWN = """# A page
```python
a = 1
```
<!-- run: echo 2 > written -->
```sh
pip install nothing-of-this-name
test "$(cat written)" = 2 && echo 3 >> written
```
<!-- not run: needs a car -->
```sh
tireid live can:can0
```
<!-- needs: no-such-program -->
```sh
no-such-program
```
<!-- file: some.toml -->
```toml
b = 4
```
<!-- c: extern int c; -->
```c
c = 5;
```
   ```python
   from pathlib import Path
   d = a + int(Path("some.toml").read_text()[-2])
   ```
```sh
echo "force  119 ± 6 N, valid"
```
<!-- printed -->
```text
force    120 ± 6 N, valid
```
<!-- background -->
```sh
echo $$ > process; sleep 100
```
"""


def test_blocks_run_in_order_in_one_namespace_and_folder(tmp_path):
    ran = run_page(page(tmp_path, SHOWN), tmp_path)
    assert ran.blocks == 8 and ran.names["d"] == 5
    assert (tmp_path / "written").read_text() == "2\n3\n"
    assert [line.split("page.md:")[1] for line in ran.left_out] == [
        "11: needs a car",
        "15: needs no-such-program",
    ]


@pytest.mark.parametrize("ends", [True, False])
def test_what_runs_in_the_background_ends_where_sigint_is_ignored(ends, tmp_path, monkeypatch):
    """As where `make docs` itself runs in the background of a shell."""
    trap = "" if ends else "trap '' INT; "
    text = f"<!-- background -->\n```sh\n{trap}touch ready; sleep 30; true\n```\n"
    text += "<!-- run: until [ -e ready ]; do sleep 0.1; done -->\n"
    monkeypatch.setattr("docs.snippets.ENDS", 2)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with contextlib.nullcontext() if ends else pytest.raises(SnippetError, match="runs on for"):
            run_page(page(tmp_path, text), tmp_path)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("text\n\n```python\na = 1\nb = a / 0\n```\n", "page.md:5: ZeroDivisionError"),
        ("```python\na = (\n```\n", "page.md:2: SyntaxError"),
        ("```sh\ntrue\nfalse\ntrue\n```\n", "page.md:3: exit code 1"),
        ("<!-- background -->\n```sh\necho bad; exit 4\n```\n<!-- run: sleep 0.3 -->\n", "bad"),
        ("<!-- c: int d; -->\n\n```c\nd = 1;\ne = 2;\n```\n", "page.md:5:"),
        ("```toml\na = = 1\n```\n", "page.md:1: Invalid value (at line 2"),
        ("```sh\necho 0.52\n```\n<!-- printed -->\n```text\n0.54\n```\n", "page.md:6: is not"),
        ("```fortran\nEND\n```\n", "page.md:1: nothing runs a block of fortran"),
    ],
)
def test_what_does_not_run_is_named_by_page_and_line(tmp_path, text, said):
    with pytest.raises(SnippetError, match=re.escape(said)):
        run_page(page(tmp_path, text), tmp_path)
