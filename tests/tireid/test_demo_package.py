"""What the demo makes of what it learnt: a package that compiles, passes and agrees with Python."""

import shutil

import pytest

from codegen import find_compiler
from tireid import exporting
from tireid.commands import demo as demo_package
from tireid.commands.demo import NOT_BUILT, package_section, ship, shipped_text
from tireid.exporting import SelfTestError


@pytest.fixture(autouse=True, scope="module")
def quick():
    """Costs on Arm have tests of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exporting, "measure", lambda *_: [])
        yield


@pytest.fixture(scope="module")
def whole(story, quick, tmp_path_factory):
    """The package as it is shipped, and its folder."""
    if find_compiler() is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("demo") / "package"
    return ship(story, folder), folder


@pytest.mark.heavy
def test_it_compiles_passes_and_computes_what_python_computes(whole):
    shipped, folder = whole
    double, single = shipped.checks
    assert double.startswith("double ") and single.startswith("float ")
    off = [float(one.partition("within ")[2].split()[0]) for one in (double, single)]
    assert off[0] < 1e-5 < off[1] < 1.0
    assert (folder / "README.md").is_file()
    for one in (double, single):
        assert "self-test passed" in one and one.endswith(", 0 samples refused")
        assert one in shipped_text(shipped)
    assert "passed" in str(package_section(shipped))


def test_without_a_compiler_the_report_says_so(story, tmp_path, monkeypatch):
    monkeypatch.setattr(demo_package, "find_compiler", lambda: None)
    shipped = ship(story, tmp_path / "package")
    assert (tmp_path / "package" / "src" / "tireid.c").is_file()
    assert NOT_BUILT in shipped_text(shipped)
    assert NOT_BUILT in str(package_section(shipped))
    monkeypatch.setattr(exporting, "find_compiler", lambda: None)
    assert exporting.self_test(tmp_path / "package", "tireid", single=False) is None


@pytest.mark.heavy
def test_a_spoiled_package_fails_its_self_test(whole, tmp_path):
    folder = shutil.copytree(whole[1], tmp_path / "package")
    vectors = folder / "tests" / "tireid_vectors.h"
    text = vectors.read_text()
    head, rows = text.split("vector_force", 1)
    first = rows.index("{", rows.index("{") + 1)
    vectors.write_text(f"{head}vector_force{rows[: first + 1]} 1e3 + {rows[first + 1 :]}")
    with pytest.raises(SelfTestError, match="forces are those of the vectors"):
        exporting.self_test(folder, "tireid", single=False)
    (folder / "src" / "tireid.c").write_text("int")
    with pytest.raises(SelfTestError, match="error"):
        exporting.self_test(folder, "tireid", single=False)
