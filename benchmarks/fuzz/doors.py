"""The doors: commands, the files that each reads, and which of them a case may mutate."""

from typing import NamedTuple

WORDS = ""  # in place of a file: the words of the command are mutated


class Door(NamedTuple):
    """A command with files that are right.

    Parameters
    ----------
    name : of it.
    share : of the cases, beside the other doors.
    words : of the command; files by name, in the working folder.
    files : that it reads.
    mutated : those that may be changed; "" are the words.
    """

    name: str
    share: float
    words: tuple[str, ...]
    files: tuple[str, ...]
    mutated: tuple[str, ...]


def _files(words: str) -> tuple[str, ...]:
    """Return the words that name files of the seeds; a car brings its tire."""
    endings = (".csv", ".csv.gz", ".parquet", ".mat", ".toml", ".json")
    found = [word for word in words.split() if word.endswith(endings) and word != "out.toml"]
    return tuple(found) + (("sedan.tir",) if "sedan.toml" in found else ())


def _door(name: str, share: float, words: str, mutated: str = "") -> Door:
    return Door(
        name,
        share,
        tuple(words.split()),
        _files(words),
        tuple(mutated.split()) or (WORDS,),
    )


IDENTIFY = "identify log.csv --vehicle car.toml --out out"
LOGGER = IDENTIFY.replace("log.csv", "logger.csv")
COMPARE = "compare log.csv --vehicle car.toml --out out --method"
PREDICT = "predict --out out"
PLAN = "plan --speed 12 --time 3 --out out"
FILTER = "--method lagged_ekf"
DRIVE = "drive --path path.csv --speed 12m/s --film none --out out"
LIVE = "live log.csv --vehicle car.toml --speed inf"
FLEET = "fleet learn log.csv --vehicle car.toml --jobs 1 --out out"
DOORS = (
    # recordings
    _door("identify csv", 14, IDENTIFY, "log.csv"),
    _door("identify csv, unchecked", 8, f"{IDENTIFY} --no-check", "log.csv"),
    _door("identify csv.gz", 4, IDENTIFY.replace(".csv", ".csv.gz"), "log.csv.gz"),
    _door("identify parquet", 4, IDENTIFY.replace(".csv", ".parquet"), "log.parquet"),
    _door("identify csv, paper", 4, f"{IDENTIFY} --paper --no-check", "log.csv"),
    _door("identify csv, filter", 2, f"{IDENTIFY} {FILTER} --no-check", "log.csv"),
    _door("identify replay", 3, f"{IDENTIFY} --replay other.csv", "other.csv"),
    _door("compare csv", 4, f"{COMPARE} axle linear", "log.csv"),
    _door(
        "check design, car",
        3,
        "check --design integral.toml --vehicle car.toml",
        "car.toml",
    ),
    # logs as loggers write them, and their map
    _door("channels csv", 6, "channels logger.csv", "logger.csv"),
    _door("channels parquet", 2, "channels log.parquet", "log.parquet"),
    _door("channels mat", 4, "channels log.mat", "log.mat"),
    _door("identify mat", 3, IDENTIFY.replace("log.csv", "log.mat"), "log.mat"),
    _door("identify logger", 6, f"{LOGGER} --log log.toml", "logger.csv log.toml"),
    _door("doctor csv", 4, "doctor log.csv --vehicle car.toml", "log.csv"),
    _door("doctor car", 2, "doctor log.csv --vehicle car.toml --repair out.toml", "car.toml"),
    # cars
    _door("identify car", 8, IDENTIFY.replace("car.toml", "sedan.toml"), "sedan.toml"),
    _door("check car", 6, "check --paper --vehicle sedan.toml", "sedan.toml"),
    _door("check default", 2, "check --vehicle sedan.toml --out out", "sedan.toml"),
    _door("export car", 5, "export --out out --vehicle sedan.toml", "sedan.toml"),
    _door("export car, FMU", 0.5, "export --out out --vehicle car.toml --fmu --onnx", "car.toml"),
    _door("export tracker", 0.2, "export --out out --mpc --vehicle car.toml", "car.toml"),
    _door("drive car", 4, f"{DRIVE} --weights axle.json --vehicle sedan.toml", "sedan.toml"),
    _door("drive tire", 4, f"{DRIVE} --tires linear --vehicle sedan.toml", "sedan.tir"),
    _door(
        "drive oracle", 1, f"{DRIVE} --tires oracle --vehicle sedan.toml", "sedan.tir sedan.toml"
    ),
    # designs
    _door("check design", 9, "check --design integral.toml --vehicle car.toml", "integral.toml"),
    _door("check design, lead", 3, "check --design lead.toml", "lead.toml"),
    _door("identify design", 5, f"{IDENTIFY} --design integral.toml", "integral.toml"),
    _door("export design", 3, "export --out out --design lead.toml", "lead.toml"),
    # frozen models
    _door("export axle", 6, "export --out out --weights axle.json", "axle.json"),
    _door("export network", 4, "export --out out --weights network.json", "network.json"),
    _door("identify axle", 6, f"{IDENTIFY} --method axle --weights axle.json", "axle.json"),
    _door("identify network", 4, f"{IDENTIFY} --paper --weights network.json", "network.json"),
    _door("drive axle", 4, f"{DRIVE} --weights axle.json", "axle.json"),
    _door(
        "drive by tires",
        2,
        f"{DRIVE.replace('12m/s', 'tires')} --confirm --weights axle.json",
        "axle.json",
    ),
    _door("drive network", 3, f"{DRIVE} --weights network.json", "network.json"),
    _door("predict curve", 2, f"{PREDICT} curve.json log.csv", "curve.json"),
    _door("drive learning", 1, f"{DRIVE} --tires learning --weights axle.json", "axle.json"),
    _door("predict axle", 4, f"{PREDICT} axle.json log.csv", "axle.json"),
    _door("predict network", 2, f"{PREDICT} network.json log.csv", "network.json"),
    _door("predict log", 4, f"{PREDICT} axle.json log.csv --no-check", "log.csv"),
    _door("predict car", 3, f"{PREDICT} axle.json log.csv --vehicle sedan.toml", "sedan.toml"),
    _door("emit axle", 3, "emit axle.json --tir out.tir --ggv out.ggv --understeer", "axle.json"),
    _door("emit network", 1, "emit network.json --tir out.tir", "network.json"),
    # fleets
    _door("fleet learn", 3, FLEET, "log.csv car.toml"),
    # live, of a replayed log
    _door("live csv", 3, LIVE, "log.csv"),
    _door("live logger", 2, f"{LIVE.replace('log.csv', 'logger.csv')} --log log.toml", "log.toml"),
    _door("live axle", 2, f"{LIVE} --weights axle.json", "axle.json"),
    # paths
    _door("drive path", 10, f"{DRIVE} --tires linear", "path.csv"),
    # words
    _door(
        "words of identify", 6, f"{IDENTIFY} --freeze 4 5 --columns r=r --seed 1 --method integral"
    ),
    _door(
        "words of check",
        6,
        "check --vehicle car.toml --method integral --bandwidth 0.7 --speed 20 --slip 0.1 "
        "--friction 1 --noise-r 0.01",
    ),
    _door("words of export", 3, "export --out out --name mine --method integral --single"),
    _door("words of compare", 3, f"{COMPARE} axle linear --seed 0"),
    _door(
        "words of drive",
        6,
        f"{DRIVE} --mu 0.9 --mu-drop 20:0.5 --tires linear --delay 20 --fault r:stuck:1:1 --seed 3",
    ),
    _door("words of predict", 3, f"{PREDICT} axle.json log.csv --columns r=r --vehicle car.toml"),
    _door("plan car", 2, f"{PLAN} --vehicle sedan.toml", "sedan.toml"),
    _door("plan weights", 2, f"{PLAN} --weights fit.json", "fit.json"),
    _door("words of plan", 3, f"{PLAN} --mu 0.8 --grip 80 --area 90 30 --steering-ratio 15"),
    _door("words of init", 2, "init out.toml"),
    _door("words of channels", 3, "channels log.csv --columns r=r --write out.toml"),
    _door("words of doctor", 2, "doctor log.csv --vehicle car.toml --columns r=r"),
    _door("words of fleet learn", 3, f"{FLEET} --tags {{vehicle}}.*"),
    _door("words of paper", 0.5, "paper --seeds 0 --out out"),
)
