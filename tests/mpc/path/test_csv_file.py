import numpy as np
import pytest

from mpc.path import Path, PathError

RING = [(30.0 * np.cos(a), 30.0 * np.sin(a)) for a in np.linspace(0, 2 * np.pi, 25)[:-1]]


def write(folder, text):
    file = folder / "track.csv"
    file.write_text(text)
    return file


def rows(points):
    return "".join(f"{x:.6f},{y:.6f}\n" for x, y in points)


@pytest.mark.parametrize("header", ["X_m,Y_m", "x,y", "# x_m,y_m", "\ufeffx, y", "X [m],Y [m]"])
def test_the_usual_headers_are_understood(tmp_path, header):
    path = Path.from_csv(write(tmp_path, f"{header}\n{rows(RING)}"))
    assert path.closed
    assert path.name == "track"
    assert path.kappa == pytest.approx(1 / 30.0, rel=0.02)


def test_other_columns_comments_empty_lines_separators_and_decimals_do_not_matter(tmp_path):
    lines = "".join(f"{k};{y:.6f};;{x:.6f}\n" for k, (x, y) in enumerate(RING)).replace(".", ",")
    path = Path.from_csv(write(tmp_path, f"n;y;note;x\n# a comment\n\n{lines}\n"))
    np.testing.assert_allclose((path.X[0], path.Y[0]), RING[0], atol=1e-9)


def test_an_open_path_stays_open_and_the_caller_decides(tmp_path):
    half = write(tmp_path, "x,y\n" + rows(RING[:13]))
    assert not Path.from_csv(half).closed
    assert Path.from_csv(half, closed=True).closed
    whole = write(tmp_path, "x,y\n" + rows(RING))
    assert not Path.from_csv(whole, closed=False).closed


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("x,z\n1,2\n", "one column must be Y_m or y, in meters, found 'x, z'"),
        ("x_mm,y_mm\n1,2\n", "one column must be X_m or x"),
        ("x,y,X_m\n1,2,3\n", "found 'x, y, X_m'"),
        ("x,y\n1,2\n3,abc\n", "y must be numeric, line 3 has 'abc'"),
        ("x,y\n1,2\n3,\n", "y must be a finite number, line 3 has none"),
        ("x,y\n1,2\nnan,3\n", "x must be a finite number, line 3 has none"),
        ("x,y\n1,2\n1,2\n3,4\n", "numbers 1 and 2 are both"),
    ],
)
def test_bad_files_are_named_with_the_place(tmp_path, text, message):
    file = write(tmp_path, text)
    with pytest.raises(PathError, match=message) as caught:
        Path.from_csv(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)
