"""What the paper's network (n_h = 10) costs in float on a Cortex-M4F: the targets are kept."""

import pytest

from codegen.processor import PROCESSORS, _size_on, missing_tools, replay
from identifier.export.processor import recording_program

pytestmark = pytest.mark.skipif(bool(missing_tools()), reason=f"needs {', '.join(missing_tools())}")


def test_the_paper_s_network_keeps_the_targets(packages, samples):
    package = packages["integral"]
    found = replay(recording_program("tireid", package.files, samples), PROCESSORS[0], single=True)
    assert 1000 < found.instructions <= 2000
    assert found.most_instructions <= 2600  # the first sample counts twice
    assert 256 < found.stack <= 800
    size = _size_on(PROCESSORS[0], "tireid", package.files, single=True)
    assert size.static_ram == 0
    assert found.state + found.params <= 400
    assert 4000 < size.flash <= 7000


@pytest.mark.heavy
def test_the_counter_counts(packages, samples):
    """A thousand additions more are a thousand additions and their loop."""
    package = packages["integral"]
    files = dict(package.files)
    place = "src/tireid.c"
    files[place] = files[place].replace(
        "    tireid_status status;\n    if ((state == NULL) || (params",
        "    tireid_status status;\n    volatile int i = 0;\n    while (i < 1000) {\n        i++;\n"
        "    }\n    if ((state == NULL) || (params",
    )
    assert files[place] != package.files[place]
    programs = [recording_program("tireid", one, samples[:500]) for one in (package.files, files)]
    before, after = (replay(one, PROCESSORS[0], single=True).instructions for one in programs)
    assert 5000 <= after - before <= 8500


def test_data_that_may_change_would_be_counted(packages):
    files = dict(packages["integral"].files)
    files["src/tireid.c"] += "int tireid_calls;\nint tireid_most = 7;\n"
    assert _size_on(PROCESSORS[0], "tireid", files, single=True).static_ram == 8
