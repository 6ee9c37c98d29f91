"""The picture of Fig. 1 of the paper: its equations stand in their frames; its files are there."""

from matplotlib.patches import FancyBboxPatch

from benchmarks.scheme_picture import BLOCKS, scheme_figure
from tireid.figures.paper import SCHEME


def test_the_scheme_holds_every_equation_inside_its_frames():
    figure = scheme_figure()
    figure.canvas.draw()
    (axes,) = figure.axes
    frames = [
        patch.get_window_extent() for patch in axes.patches if isinstance(patch, FancyBboxPatch)
    ]
    inside = [text for text in axes.texts if text.get_text() in {b.text for b in BLOCKS.values()}]
    assert len(frames) == len(inside) == len(BLOCKS)
    for frame, text in zip(frames, inside, strict=True):
        written = text.get_window_extent()
        assert frame.x0 < written.x0 < written.x1 < frame.x1, text.get_text()
        assert frame.y0 < written.y0 < written.y1 < frame.y1, text.get_text()
    said = " ".join(text.get_text() for text in inside)
    for equation in ("(6)", "(7)", "(8)", "(10)", "(11)-(13)"):
        assert equation in said
    labels = [text for text in axes.texts if text not in inside and text.get_text()]
    for label in labels:
        for frame in frames:
            assert not label.get_window_extent().overlaps(frame), label.get_text()
    assert SCHEME.read_bytes().startswith(b"\x89PNG")
    assert SCHEME.with_suffix(".svg").read_bytes().startswith(b"<?xml")
