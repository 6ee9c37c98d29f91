"""The package of logs by its face: NumPy alone, nothing of cars, from a file to samples."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

import tireid as ti

ROOM = Path(__file__).resolve().parents[3] / "models" / "logs"
BESIDE = {
    *("codegen.arrays", "codegen.errors", "codegen.escape", "codegen.face"),
    *("models.apart", "models.extras", "models.limits", "models.schema"),
}
OPTIONAL = {"h5py", "pyarrow", "asammdf", "rosbags", "cantools", "can"}
ALONE = """
import json
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("casadi", "scipy", "control", "matplotlib", "PIL"):
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Hidden())
from models.logs import RecordingError, open_log, propose
log = open_log(sys.argv[1])
listed = [one.name for one in log.listed()]
found = propose(log)
name = found.guesses["r"].channel[0]
[channel] = log.read([name])
try:
    open_log(sys.argv[1] + ".absent")
except RecordingError as error:
    assert "no such file" in str(error)
print(json.dumps([found.is_sure("v_x"), name, len(channel.t), channel.values[700], listed]))
assert not {"models.vehicle", "models.recordings", "models.tires", "identifier"} & set(sys.modules)
"""


def outside(path):
    """What a file of the room imports that is neither of the room nor of Python."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module


def test_the_room_imports_numpy_itself_and_what_knows_nothing_of_cars():
    for path in ROOM.glob("*.py"):
        for name in outside(path):
            top = name.partition(".")[0]
            mine = name.startswith("models.logs") or name in BESIDE
            known = top in sys.stdlib_module_names or top in OPTIONAL | {"numpy"}
            assert mine or known, f"{path.name} imports {name}"


def test_a_log_is_read_where_there_is_numpy_alone(tmp_path):
    log = ti.sample_recording(ti.sedan())
    file = tmp_path / "drive.csv"
    table = np.column_stack([log.t, log.v_x, log.r])
    names = "Time [s],Speed [m/s],YawRate [rad/s]"
    np.savetxt(file, table, "%.17g", delimiter=",", header=names, comments="")
    done = subprocess.run(
        [sys.executable, "-c", ALONE, str(file)],
        capture_output=True,
        text=True,
        cwd=ROOM.parents[1],
    )
    assert done.returncode == 0, done.stderr
    names = ["Speed [m/s]", "YawRate [rad/s]"]
    assert json.loads(done.stdout) == [True, names[1], log.t.size, log.r[700], names]
