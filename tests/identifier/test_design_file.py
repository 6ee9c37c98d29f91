"""design.toml comes back exactly, and is refused in one line that names the key."""

from dataclasses import replace

import pytest

from identifier.paper.design import DesignFileError, PaperIdentifier, design_text, read_design
from tests.refused import line_about


def test_a_design_comes_back_from_its_file(car, tmp_path):
    design = PaperIdentifier.for_vehicle(car)
    odd = replace(
        design,
        law="pi_lead",
        seed=7,
        gains=replace(design.gains, A_d=((-3.0, 1.0), (0.25, -7.1)), lead=0.1 + 0.2),
    )
    for one in (design, odd):
        path = tmp_path / "design.toml"
        path.write_text(design_text(one))
        assert read_design(path) == one


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("eta_W = ", "eta = ", "gains.eta is unknown"),
        ("forgetting = ", "# forgetting = ", "gains.forgetting is missing"),
        ("[gains]", "gains = 3\n[other]", "gains must be a table"),
        ('law = "integral"', 'law = "magic"', "law must be one of"),
        ("seed = 0", "seed = 0.5", "seed must be a whole number"),
        ("forgetting = ", "forgetting = -", "forgetting must be positive"),
        ("lead = 0.0", "lead = -1.0", "lead must not be negative"),
        ("lead = 0.0", "lead = nan", "lead must not be negative"),
        ("seed = 0", 'integrator = "rk4"', "integrator is unknown"),
        ("A_d = [[-", "A_d = [[", "must be Hurwitz, its eigenvalues are"),
        ("dt = 0.01", "dt = [", "cannot be read as TOML"),
    ],
)
def test_a_wrong_file_is_refused_by_its_key(car, tmp_path, old, new, said):
    text = design_text(PaperIdentifier.for_vehicle(car))
    assert old in text
    path = tmp_path / "design.toml"
    path.write_text(text.replace(old, new))
    assert said in line_about(path, DesignFileError, read_design)
