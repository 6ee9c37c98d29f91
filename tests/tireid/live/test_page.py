"""The page of a live run, in a browser: what it says, how wide it is, what it remembers."""

import base64
import os
import socket
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from tests.tireid.live.test_outputs import FREE, address, made
from tireid.live.outputs import OutputError, Outputs

WIDE, NARROW = 1200, 500  # px
# A folder into which each picture is written, to be looked at.
PICTURES = os.environ.get("TIREID_PICTURES")
NAN = np.nan
KILO = ("force", "force_sd", "stiffness", "stiffness_sd")  # of a car, smaller of a model of one
UNKNOWN = {
    **dict.fromkeys(["friction", "friction_since", "side_slip", "side_slip_sd", "point"]),
    **dict.fromkeys(["understeer", "understeer_sd", "a_y_limit", "a_y_limit_sd"], NAN),
    **dict.fromkeys(["known_slip", "grip", "grip_sd", "stiffness_sd"], np.full(2, NAN)),
    **dict.fromkeys(["force", "force_sd"], np.full((2, 41), NAN)),
}


def look(tab, name):
    """Look at both widths: nothing is cut off at the right, nothing went wrong."""
    for width in (WIDE, NARROW):
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        tab.call("Emulation.setDeviceMetricsOverride", **size)
        tab.wait("plots.slip.width > 0 && plots.slip.width <= $('slip').clientWidth")
        assert tab.value("document.documentElement.scrollWidth") <= width
        if PICTURES:
            time.sleep(0.3)
            picture = tab.call("Page.captureScreenshot", captureBeyondViewport=True)["data"]
            path = Path(PICTURES) / f"{name}_{width}.png"
            path.write_bytes(base64.b64decode(picture))
    assert not tab.errors


def free_pair():
    """Return a port that is free, as the next one is."""
    for _ in range(100):
        with socket.socket() as first, socket.socket() as second:
            first.bind((FREE[0], 0))
            port = first.getsockname()[1]
            with suppress(OSError, OverflowError):
                second.bind((FREE[0], port + 1))
                return port
    raise AssertionError("no two free ports in a row")


def served(place):
    """Return outputs at a place, which a run before may hold for a moment."""
    for _ in range(50):
        with suppress(OutputError):
            return Outputs(place)
        time.sleep(0.1)
    return Outputs(place)


def test_the_page_says_what_is_known_and_when_nothing_comes(tab):
    pytest.importorskip("foxglove")
    place = (FREE[0], free_pair())
    with served(place) as outputs:
        tab.call("Page.navigate", url=address(outputs, "http"))
        text = "document.body.innerText"
        tab.wait("typeof state !== 'undefined' && state !== null", lambda: outputs.send(made(0.0)))
        for k in range(50):  # 7 min, of which the page remembers five
            outputs.send(made(8.4 * (k + 1)))
            time.sleep(0.001)
        tab.wait("memory.length && memory.at(-1).t === 420")
        assert tab.value("memory[0].t >= 120 && memory.length") == 36
        good = "valid.className === 'good' && !document.body.className"
        tab.wait(good, lambda: outputs.send(made(420.2)))
        shown = tab.value(text)
        for words in ("100.0 ± 2.0", "0.57 ± 0.23", "lost\t3", "-0.34 ± 0.04", "1.74"):
            assert words in shown
        look(tab, "good")
        small = made(420.3, **{n: getattr(made(0.0), n) / 1e3 for n in KILO})
        tab.wait(f"{text}.includes('Stiffness [N/rad]\\t100.0')", lambda: outputs.send(small))
        assert tab.value("plots.rear.axes[1].label") == "force [N]"
        look(tab, "small")
        alarm = "friction 0.62 of the reference"
        bad = made(420.4, valid=False, reason="another road", alarm=alarm, friction=0.62)
        tab.wait(f"{text}.includes({alarm!r})", lambda: outputs.send(bad))
        assert tab.value("[$('valid').className, $('alarm').className].join()") == "doubt,bad"
        look(tab, "alarm")
        nothing = made(420.6, valid=False, origin="stored", **UNKNOWN)
        tab.wait(f"{text}.includes('the curves are stored')", lambda: outputs.send(nothing))
        assert "Understeer gradient [deg/g]\t-\nLargest a_y [m/s²]\t-" in tab.value(text)
        look(tab, "unknown")
        tab.wait(f"{text}.includes('nothing came for 2 s')")
        look(tab, "old")
    with served(place) as outputs:  # the next run, at the same ports
        tab.wait(good, lambda: outputs.send(made(0.0)))
