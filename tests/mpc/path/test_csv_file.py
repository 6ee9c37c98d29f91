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


HEADERS = [
    "X_m,Y_m",
    "x,y",
    "\ufeffx, y",
    "X [m],Y [m]",
    "Pos X (m),Pos Y (m)",
    "east_m,north_m",
    "",
]


@pytest.mark.parametrize("scale", [1.0, 0.04])  # a 1:10 car turns at 1.2 m
@pytest.mark.parametrize("header", HEADERS)
def test_the_usual_headers_are_understood(tmp_path, header, scale):
    ring = scale * np.array(RING)
    path = Path.from_csv(write(tmp_path, f"{header}\n{rows(ring)}"))
    assert path.closed
    assert path.name == "track"
    assert path.kappa == pytest.approx(1 / 30.0 / scale, rel=0.02)


WIDE = np.column_stack((RING, np.full((24, 2), 1.1)))
LINE = np.column_stack((np.arange(24.0), RING, np.ones((24, 4))))


@pytest.mark.parametrize(
    ("head", "table", "apart"),
    [
        ("# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2", LINE, "; "),
        ("# 5f0c\n# s_m;x_m;y_m;psi_rad;kappa_radpm;vx_mps;ax_mps2", LINE, ";"),
        ("", LINE, ";"),
        ("# x_m, y_m, w_tr_right_m, w_tr_left_m", WIDE, ", "),
        ("", WIDE, ", "),
        ("x_mm\ty_mm", 1e3 * np.array(RING), "\t"),
        ("x;y", RING, ";"),
    ],
)
@pytest.mark.parametrize("again", [0, 1])
def test_race_lines_and_center_lines_are_read_with_or_without_the_first_point_again(
    tmp_path, head, table, apart, again
):
    text = "".join(apart.join(f"{x:.3f}" for x in row) + "\n" for row in [*table, *table[:again]])
    text = text.replace(".", ",") if head == "x;y" else text
    path = Path.from_csv(write(tmp_path, f"{head}\n{text}"))
    assert path.closed
    assert path.length == pytest.approx(60.0 * np.pi, rel=1e-4)
    np.testing.assert_allclose((path.X[0], path.Y[0]), RING[0], atol=1e-9)


def test_other_columns_comments_empty_lines_separators_and_decimals_do_not_matter(tmp_path):
    lines = "".join(f"{k};{y:.6f};;{x:.6f}\n" for k, (x, y) in enumerate(RING)).replace(".", ",")
    path = Path.from_csv(write(tmp_path, f"n;y;note;x\n# a comment\n\n{lines}\n"))
    np.testing.assert_allclose((path.X[0], path.Y[0]), RING[0], atol=1e-9)


def test_an_open_path_stays_open_and_the_caller_decides(tmp_path):
    half = write(tmp_path, "x,y\n" + rows(RING[:13]))
    assert repr(Path.from_csv(half)).endswith(" m, open>")
    assert Path.from_csv(half, closed=True).closed
    whole = write(tmp_path, "x,y\n" + rows(RING))
    assert not Path.from_csv(whole, closed=False).closed


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("x,z\n1,2\n", r"must be x and y, in a unit of length \(x_m, .*, found 'x, z'"),
        ("x [deg/s],y [deg/s]\n1,2\n", "must be x and y"),
        ("x,y,X_m\n1,2,3\n", "found 'x, y, X_m'"),
        ("x,y\n1,2\n3,abc\n", "y must be numeric, line 3 has 'abc'"),
        ("x,y\n1,2\n3,\n", "y must be a finite number, line 3 has none"),
        ("x,y\n1,2\nnan,3\n", "x must be a finite number, line 3 has none"),
        ("x,y\n1,2\n1,2\n3,4\n", "numbers 1 and 2 are both"),
        ("x,y\n8.4,49\n8.40028,49\n8.4002,48.9999\n", "is 0.00041 m long: are X and Y degrees"),
    ],
)
def test_bad_files_are_named_with_the_place(tmp_path, text, message):
    file = write(tmp_path, text)
    with pytest.raises(PathError, match=message) as caught:
        Path.from_csv(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)
