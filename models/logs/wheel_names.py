"""Which channel of a log is the speed of which wheel, by the words of its name.

Loggers say "Wheel Speed FL", "WHL_SPD_FL", "ESP_VL_Radgeschw", "nWheelFL", "Vhcl.FL.rotv",
"omega_rl", "ws_rr"; a model car with one encoder has "encoder" or "wheel_speed".
"""

from collections.abc import Mapping, Sequence

from models.logs.signals import WHEELS


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


PLACES: Mapping[str, tuple[frozenset[str], ...]] = {
    name: tuple(map(_set, ways))
    for name, ways in {
        "wheel_fl": ("fl", "lf", "vl", "front left", "vorne links"),
        "wheel_fr": ("fr", "rf", "vr", "front right", "vorne rechts"),
        "wheel_rl": ("rl", "lr", "hl", "rear left", "hinten links"),
        "wheel_rr": ("rr", "hr", "rear right", "hinten rechts"),
    }.items()
}


ANYWHERE = frozenset(word for ways in PLACES.values() for way in ways for word in way)
WHEEL = _set("wheel wheels whl rad tire tyre")
TURNS = _set(
    "speed speeds spd vel velocity v n w omega rot rotv rpm rotation rotational drehzahl geschw "
    "geschwindigkeit angular encoder rate"
)
BOTH = _set(
    "wheelspeed wheelspd whlspd whlspeed wspeed wspd wheelvel wheelrpm wheelomega nwheel vwheel ws "
    "radgeschw radgeschwindigkeit raddrehzahl rotv omega"
)
ENCODER = _set("encoder wheelencoder wheelspeed wheelspd whlspd")
OTHERS = _set(
    "steering steer hand engine motor slip ratio angle ang force torque moment pressure temp "
    "temperature acc accel acceleration load brake height travel camber toe lateral y z position "
    "pos pulse pulses ticks count counter direction dir based valid status error quality state "
    "target desired ref request cmd command limit max min std cov var offset sas lws"
)


def wheel_words(signal: str, words: Sequence[str]) -> bool:
    """Return whether a name is that of the speed of a wheel.

    Parameters
    ----------
    signal : one of `WHEELS`.
    """
    listed = frozenset(words)
    if listed & OTHERS:
        return False
    if signal == WHEELS[-1]:
        turns = listed & ENCODER or (listed & WHEEL and listed & TURNS) or listed == {signal}
        return bool(turns and not listed & ANYWHERE)
    for place in PLACES[signal]:
        rest = listed - place
        if listed >= place and not rest & ANYWHERE:
            return bool(rest & BOTH or (rest & WHEEL and (rest & TURNS or rest <= WHEEL)))
    return False
