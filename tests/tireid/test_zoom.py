"""Plots of a report: small, true to the figure, and drawn by a browser in place of a picture."""

import json
import re
import zlib
from base64 import b64decode

import numpy as np
import pytest

from tests.tireid.test_report import page_of
from tireid.figures.style import axle_panels, figure_png, save_figures, styled
from tireid.report import Picture, Section
from tireid.zoom import LARGEST, Drawn, Series, plots_html, zoom_of

HOSTILE = "</script><img src=x onerror=alert(1)>"
TIME, SLIP = 1.7e9 + np.arange(20_000) / 100.0, np.linspace(-9.0, 9.0, 200)


@styled
def figure_of(rows, rng):
    """Noisy forces over time in rows, below them a curve in its band with a cloud and a shade."""
    figure, panels = axle_panels([1.0] * (rows + 1), sharex=False)
    for axes in panels[:-1].ravel():
        for name in ("truth", "online", "model"):
            axes.plot(TIME, rng.normal(0.0, 3.0, len(TIME)), label=name)
        axes.set(ylabel="force\n[kN]", xlabel="time since 1700000000 s [s]")
    for axes in panels[-1]:
        with_gap = np.where(np.arange(len(SLIP)) == 50, np.nan, SLIP)
        axes.fill_between(with_gap, SLIP - 1.0, SLIP + 1.0, label="band")
        axes.plot(SLIP, SLIP, label="curve")
        axes.plot(*rng.normal(0.0, 3.0, (2, len(TIME))), "k.", label="cloud")
        axes.axvspan(7.0, 9.0, label="not known")
        axes.set_xlabel(r"slip $\alpha$ [deg]")
    panels[0, 0].set_title(HOSTILE)
    return figure


def unpacked(page):
    """Panels by figure, and their arrays as numbers, as a browser finds them in a page."""
    (packed,) = re.findall(r'id="zoom-data">([^<]*)<', page)
    data = json.loads(zlib.decompress(b64decode(packed)))
    arrays = []
    for decimals, *steps in data["arrays"]:
        known = np.cumsum([step or 0 for step in steps]) / 10.0**decimals
        arrays.append(np.where([step is None for step in steps], np.nan, known))
    return data["figures"], arrays


def test_plots_of_many_long_signals_are_small_and_as_the_figure_has_them():
    figure = figure_of(4, np.random.default_rng(1))
    page = plots_html({"figure-1": zoom_of(figure)}, {})
    assert 0.8 * LARGEST < len(page.encode()) <= LARGEST
    figures, arrays = unpacked(page)
    panels = figures["figure-1"]
    assert panels[0]["title"] == HOSTILE and HOSTILE not in page
    assert panels[1]["up"] == "force [kN]" and panels[-1]["across"] == "slip alpha [deg]"
    for panel, axes in zip(panels[:8], figure.axes, strict=False):
        for line, drawn in zip(panel["series"], axes.lines, strict=True):
            t, force = arrays[line["x"]], arrays[line["y"]]
            assert t[0] == 0.0 and np.all(np.diff(t) >= 0.0)
            ends = drawn.get_ydata().min(), drawn.get_ydata().max()
            assert (force.min(), force.max()) == pytest.approx(ends, abs=0.005)
    low, high, curve, cloud = panels[-1]["series"]
    assert [one["kind"] for one in (low, high, curve, cloud)] == ["low", "high", "line", "points"]
    for one, offset, gap in ((low, -1.0, [50]), (high, 1.0, [50]), (curve, 0.0, [])):
        x, y = arrays[one["x"]], arrays[one["y"]]
        assert np.flatnonzero(np.isnan(y)).tolist() == gap
        assert np.delete(y, gap) == pytest.approx(np.delete(x, gap) + offset, abs=1e-4)
    assert len(arrays[cloud["x"]]) < 320 and panels[-1]["spans"][0][:2] == [7.0, 9.0]


def test_replays_have_a_zoom_while_that_leaves_the_others_fine(tmp_path, undrawn):
    names, rng = ["error", *(f"replay_{k}" for k in range(4)), "forces"], np.random.default_rng(4)
    images = save_figures(tmp_path, {name: figure_of(1, rng) for name in names})
    figures, arrays = unpacked(page_of("t", [Section("h", [Picture(images[n], n) for n in names])]))
    assert list(figures)[:2] == ["figure-6", "figure-2"] and len(figures) < 5
    assert all(len(arrays[figures["figure-6"][0]["series"][k]["y"]]) >= 280 for k in range(3))


def test_a_thinned_line_has_every_peak_and_the_gaps_between_segments():
    x, y = np.arange(10_000.0), np.sin(np.arange(10_000) / 900.0)
    y[[1234, 7777]], y[5000] = (9.0, -9.0), np.nan
    line = Series("v_y", "#000000", "line", x, y).thinned(100)
    assert len(line.x) == 200 and np.all(np.diff(line.x) >= 0.0)
    assert np.nanmax(line.y) == 9.0 and np.nanmin(line.y) == -9.0
    assert np.flatnonzero(np.isnan(line.y)).tolist() == [101]  # of the column from 5000 on
    band = Series("v_y", "#000000", "high", x, y).thinned(100)
    assert np.all(band.y[band.x == 1200.0] == 9.0)


def test_a_report_without_scripts_has_its_picture_and_what_is_not_drawn_no_script():
    image = Drawn(figure_png(figure_of(1, np.random.default_rng(2)), resolution=30))
    without = page_of("t", [Section("h", [Picture(image, "c")])])
    assert "<script" not in without
    image.zoom = zoom_of(figure_of(1, np.random.default_rng(2)))
    page = page_of("t", [Section("h", [Picture(image, "c")])])
    assert re.sub(r"<script.*</script>\n", "", page, flags=re.DOTALL) == without


def test_a_browser_draws_zooms_reads_and_goes_back(tab, tmp_path):
    figure = figure_of(1, np.random.default_rng(3))
    image = Drawn(figure_png(figure, resolution=30))
    image.zoom = zoom_of(figure)
    path = tmp_path / "report.html"
    path.write_text(page_of("t", [Section("h", [Picture(image, "c")])]), encoding="utf-8")
    tab.call("Page.navigate", url=path.as_uri())
    tab.wait("document.querySelector('figure > button')?.textContent === 'Zoom'")
    shown = "document.querySelector('figure img').checkVisibility()"
    assert tab.value(shown) is True
    tab.value("document.querySelector('figure > button').click()")
    tab.wait("document.querySelectorAll('.uplot canvas').length === 4")
    assert tab.value(shown) is False
    assert tab.value("document.querySelector('.u-title').textContent") == HOSTILE
    over = "document.querySelector('.u-over')"
    box = f"{over}.scrollIntoView(), JSON.stringify({over}.getBoundingClientRect())"
    box = json.loads(tab.value(box))
    for kind, share, button in (  # from 100 s to 150 s
        ("mouseMoved", 0.5, "none"), ("mousePressed", 0.5, "left"), ("mouseMoved", 0.75, "left"),
        ("mouseReleased", 0.75, "left"), ("mouseMoved", 0.1, "none"),
    ):  # fmt: skip
        at = {"x": box["x"] + share * box["width"], "y": box["y"] + box["height"] / 2.0}
        clicks = int(button == "left")
        tab.call("Input.dispatchMouseEvent", type=kind, **at, button=button, clickCount=clicks)
    read = "Number(document.querySelector('.u-legend .u-value').textContent)"
    tab.wait(f"Math.abs({read} - 105) < 2")
    tab.value("document.querySelector('figure > button').click()")
    assert tab.value(shown) is True and not tab.errors
