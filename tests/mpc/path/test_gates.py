import numpy as np
import pytest

from mpc.path import iso_3888_1, iso_3888_2, slalom

# start, end, width, right edge above that of the first gate; b is the width of the car
TABLE = {
    iso_3888_1: lambda b: [
        (0.0, 15.0, 1.1 * b + 0.25, 0.0),
        (45.0, 70.0, 1.2 * b + 0.25, 3.5),
        (95.0, 125.0, 1.3 * b + 0.25, 0.0),
    ],
    iso_3888_2: lambda b: [
        (0.0, 12.0, 1.1 * b + 0.25, 0.0),
        (25.5, 36.5, b + 1.0, 1.1 * b + 1.25),
        (49.0, 61.0, max(1.3 * b + 0.25, 3.0), 0.0),
    ],
}


@pytest.mark.sweep("1.6-iso_3888_1", "2.2-iso_3888_2")
@pytest.mark.parametrize("build", TABLE)
@pytest.mark.parametrize("b", [1.6, 2.2])
def test_the_car_passes_between_the_cones_of_the_standard(build, b):
    path = build(car_width=b)
    for start, end, width, offset in TABLE[build](b):
        right = offset - 0.5 * (1.1 * b + 0.25)
        inside = (start <= path.X) & (end >= path.X)
        assert path.Y[inside].min() - 0.5 * b > right + 0.05 - 1e-3
        assert path.Y[inside].max() + 0.5 * b < right + width - 0.05 + 1e-3
        cones = path.cones[(path.cones[:, 0] >= start) & (path.cones[:, 0] <= end)]
        assert sorted(set(cones[:, 1].round(9))) == pytest.approx([right, right + width])
        assert (cones[:, 0].min(), cones[:, 0].max()) == (start, end)
        assert np.diff(np.unique(cones[:, 0])).max() <= 3.0
    assert len(path.cones) == sum(
        np.count_nonzero((path.cones[:, 0] >= start) & (path.cones[:, 0] <= end))
        for start, end, *_ in TABLE[build](b)
    )


@pytest.mark.parametrize(
    ("build", "easing"), [(iso_3888_1, 10.0), (iso_3888_2, 6.0), (slalom, 6.0)]
)
def test_curvature_takes_its_time(build, easing):
    path = build()
    rate = np.abs(np.diff(path.kappa) / path.step).max()
    assert rate <= 1.01 * path.peak_curvature / easing
    assert abs(path.kappa[[0, -1]]).max() < 1e-6


def test_lane_changes_begin_and_end_along_the_lane():
    for build, last in ((iso_3888_1, 125.0), (iso_3888_2, 61.0)):
        path = build()
        ends = [(path.X[k], path.Y[k], path.psi[k]) for k in (0, -1)]
        assert ends[0] == pytest.approx((-40.0, 0.0, 0.0), abs=1e-6)
        assert ends[1] == pytest.approx((last + 40.0, 0.0, 0.0), abs=1e-6)


def test_a_slalom_passes_the_cones_left_and_right_in_turn():
    path = slalom(cones=5, gap=20.0)
    assert path.cones == pytest.approx(np.column_stack((20.0 * np.arange(5), np.zeros(5))))
    sides = [path.project(x, y) for x, y in path.cones]
    assert [np.sign(-side.e_y) for side in sides] == [1, -1, 1, -1, 1]
    assert min(abs(side.e_y) for side in sides) > 1.15  # measured square to the path, not to x
