"""FMUs run by FMPy, sample by sample, against the step in Python."""

from dataclasses import replace

import numpy as np
import pytest

from codegen import Scan
from identifier.export import fmu as binaries
from identifier.export.fmu import export_fmu
from identifier.export.specialize import specialize
from identifier.paper.design import PaperIdentifier
from identifier.run import OnlineIdentifier, identify
from models.recordings import Recording
from models.vehicle import sedan

fmpy = pytest.importorskip("fmpy", reason="needs the package fmpy")
if not binaries.targets():
    pytest.skip("needs a C compiler on Linux x86-64", allow_module_level=True)

INPUTS, FORCES, STATUS, SAMPLES, ADAPTATION = (1, 2, 3, 4, 5), (6, 7), 8, 9, 10
CAR = sedan()


def design(dt=0.01):
    return replace(PaperIdentifier.for_vehicle(CAR), dt=dt)


def swaying(n, dt=0.01):
    """Signals of a car that sways; nothing says that they fit together."""
    t = dt * np.arange(n)
    return Recording(
        name="swaying",
        t=t,
        v_x=20 + 2 * np.sin(0.3 * t),
        v_y=0.1 + 0.5 * np.sin(2.0 * t),
        r=0.3 * np.sin(2.0 * t + 0.4),
        delta_f=0.04 * np.sin(2.0 * t + 0.9),
        delta_r=0.01 * np.sin(1.3 * t),
    )


def rows(drive):
    return np.column_stack([drive.v_x, drive.v_y, drive.r, drive.delta_f, drive.delta_r])


class Master:
    """An instance of an FMU of either version, asked for with the same words."""

    def __init__(self, path, folder, start_time=0.0):
        folder.mkdir(parents=True, exist_ok=True)
        fmpy.extract(str(path), str(folder))
        about = fmpy.read_model_description(str(path))
        slave = {"2.0": fmpy.fmi2.FMU2Slave, "3.0": fmpy.fmi3.FMU3Slave}[about.fmiVersion]
        self.two = about.fmiVersion == "2.0"
        self.fmu = slave(
            guid=about.guid,
            unzipDirectory=str(folder),
            modelIdentifier=about.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.fmu.instantiate()
        self.begin(start_time)

    def begin(self, start_time):
        if self.two:
            self.fmu.setupExperiment(startTime=start_time)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start_time)
        self.fmu.exitInitializationMode()

    def set(self, values):
        (self.fmu.setReal if self.two else self.fmu.setFloat64)(INPUTS, values)

    def step(self, t, h):
        self.fmu.doStep(t, h)

    def forces(self):
        return (self.fmu.getReal if self.two else self.fmu.getFloat64)(FORCES)

    def count(self, reference):
        return (self.fmu.getInteger if self.two else self.fmu.getInt32)([reference])[0]

    def run(self, inputs, dt, first=0):
        """Forces after each of the rows, which begin at sample `first`."""
        forces = np.empty((len(inputs), 2))
        for k, row in enumerate(inputs):
            self.set(row)
            self.step((first + k) * dt, dt)
            forces[k] = self.forces()
        return forces

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Path of the FMU of a version and sampling interval, written once; Linux only, for speed."""
    folder, written = tmp_path_factory.mktemp("fmu"), {}

    def path(version=2, dt=0.01):
        key = version, dt
        if key not in written:
            written[key] = folder / f"v{version}_{dt}.fmu"
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(binaries, "MINGW", "no-such-compiler")
                export_fmu(specialize(design(dt), CAR), written[key], version)
        return written[key]

    return path


@pytest.fixture(name="master")
def a_master(exported, tmp_path):
    """The function `master(version, dt)`, which starts an instance."""
    started = []

    def start(version=2, dt=0.01, **options):
        started.append(Master(exported(version, dt), tmp_path / str(len(started)), **options))
        return started[-1]

    yield start
    for one in started:
        one.close()


def in_python(drive, start=None):
    """The folded step over a drive, after one sample at rest; exact, no tolerance."""
    specialized = specialize(design(drive.dt), CAR)
    scan = Scan(specialized.function, carry=tuple(specialized.carry), over=("x", "u", "v_x"))
    if start is None:
        first = {"x": drive.x[:1], "u": drive.u[:1], "v_x": np.zeros(1)}
        rest = scan(1, {**specialized.carry, **first})
        start = {port: rest[f"{port}_final"] for port in specialized.carry}
    return scan(drive.t.size, {**start, "x": drive.x, "u": drive.u, "v_x": drive.v_x})


@pytest.mark.sweep("0.01-2")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("dt", [0.001, 0.01])
def test_forces_are_those_of_python_to_the_last_bit(master, version, dt):
    drive = swaying(1500, dt)
    forces = master(version, dt).run(rows(drive), dt)
    assert np.abs(forces).max() > 1000
    assert np.abs(forces - in_python(drive)["axle_force"]).max() == 0.0


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_simulates_it_in_one_call(exported, version):
    drive = swaying(300)
    names = ("time", "v_x", "v_y", "r", "delta_f", "delta_r")
    table = np.zeros(drive.t.size, dtype=[(name, float) for name in names])
    table["time"] = drive.t
    for name in names[1:]:
        table[name] = getattr(drive, name)
    told = fmpy.simulate_fmu(
        str(exported(version)), stop_time=3.0, step_size=0.01, output_interval=0.01, input=table
    )
    expected = identify(drive, CAR, design()).axle_force
    forces = np.column_stack([told["F_yf"], told["F_yr"]])[1:]  # a step ends with its forces
    assert told["samples"].tolist() == list(range(301))
    assert np.abs(forces - expected).max() < 1e-6  # FMPy interpolates inputs, with rounding


def test_a_long_step_takes_its_samples_with_inputs_held(master):
    drive, one = swaying(400), master()
    coarse = np.array([one.run(rows(drive)[k : k + 1], 0.04, k // 4)[0] for k in range(0, 400, 4)])
    held = 4 * (np.arange(400) // 4)
    signals = ("v_x", "v_y", "r", "delta_f", "delta_r")
    steps = replace(drive, **{name: getattr(drive, name)[held] for name in signals})
    assert (coarse == in_python(steps)["axle_force"][3::4]).all()


def save(one):
    fmu = one.fmu
    state = fmu.getFMUState()
    saved = (fmu.serializeFMUstate if one.two else fmu.serializeFMUState)(state)
    fmu.freeFMUState(state)
    return saved


def restore(one, saved):
    fmu = one.fmu
    state = (fmu.deSerializeFMUstate if one.two else fmu.deserializeFMUState)(saved)
    fmu.setFMUState(state)
    fmu.freeFMUState(state)


@pytest.mark.parametrize("version", [2, 3])
def test_a_saved_state_goes_on_as_if_nothing_had_happened(master, version):
    inputs, one, other = rows(swaying(200)), master(version), master(version)
    one.run(inputs[:120], 0.01)
    saved = save(one)
    through = one.run(inputs[120:], 0.01, first=120)
    restore(one, saved)
    assert one.count(SAMPLES) == 120
    assert (one.run(inputs[120:], 0.01, first=120) == through).all()
    other.run(-inputs[:10], 0.01)
    restore(other, saved)
    assert (other.run(inputs[120:], 0.01, first=120) == through).all()


@pytest.mark.parametrize("version", [2, 3])
def test_after_a_reset_it_waits_for_its_initialization_and_is_as_new(master, version):
    inputs, one = rows(swaying(60)), master(version)
    first = one.run(inputs, 0.01)
    one.fmu.reset()
    with pytest.raises(Exception, match="status 3"):
        one.step(0.0, 0.01)
    one.fmu.reset()
    one.begin(0.0)
    assert (one.run(inputs, 0.01) == first).all()


@pytest.mark.sweep("3")
@pytest.mark.parametrize("version", [2, 3])
def test_the_state_of_another_model_is_refused(master, version, capfd):
    saved = save(master(version, dt=0.001))
    with pytest.raises(Exception, match="status 3"):
        restore(master(version), saved)
    assert "not a saved state of this FMU" in capfd.readouterr().out


@pytest.mark.parametrize("version", [2, 3])
def test_a_wrong_token_is_refused(exported, tmp_path, version, capfd, monkeypatch):
    real = fmpy.read_model_description

    def forged(path):
        about = real(path)
        about.guid = "{another}"
        return about

    monkeypatch.setattr(fmpy, "read_model_description", forged)
    with pytest.raises(Exception, match="instantiate"):
        Master(exported(version), tmp_path / "forged")
    assert "not that of this FMU" in capfd.readouterr().out


def test_instances_do_not_disturb_each_other(master):
    drive, one, other = swaying(100), master(), master()
    forces = np.empty((100, 2))
    for k, row in enumerate(rows(drive)):
        for instance, values in ((one, row), (other, 2 * row)):
            instance.set(values)
            instance.step(0.01 * k, 0.01)
        forces[k] = one.forces()
    assert (forces == in_python(drive)["axle_force"]).all()


def test_without_adaptation_it_is_the_frozen_model(master):
    drive, one = swaying(600), master()
    one.run(rows(drive)[:400], 0.01)
    one.fmu.setBoolean([ADAPTATION], [False])
    forces = one.run(rows(drive)[400:], 0.01, first=400)
    history = identify(drive, CAR, design())
    frozen = history.freeze(drive.t[400]).predict(drive)[400:]
    assert np.abs(forces - frozen).max() < 1e-9
    assert np.abs(frozen - history.axle_force[400:]).max() > 10  # with adaptation it moved on


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", range(5))
def test_a_bad_sample_is_told_and_counts_as_time(master, bad, column):
    inputs, one = rows(swaying(60)), master()
    before = one.run(inputs[:30], 0.01)[-1]
    inputs[30, column] = bad
    held = one.run(inputs[30:31], 0.01, first=30)[0]
    assert one.count(STATUS) == 3
    assert (held == before).all()
    after = one.run(inputs[31:], 0.01, first=31)
    assert one.count(STATUS) == 0
    online = OnlineIdentifier(design(), CAR, 0.01)
    beside = np.array([online.update(row[1:3], row[3:], row[0]) for row in inputs])
    assert np.abs(after - beside[31:]).max() < 1e-9


def test_forces_are_zero_and_stale_where_no_sample_comes_for_half_a_second(master):
    inputs, one = rows(swaying(120)), master()
    inputs[30:90, 2] = np.nan
    forces = one.run(inputs[:79], 0.01)
    assert (one.count(STATUS), (forces[-1] == forces[29]).all()) == (3, True)
    forces = one.run(inputs[79:90], 0.01, first=79)
    assert (one.count(STATUS), (forces == 0.0).all()) == (6, True)
    assert (one.run(inputs[90:], 0.01, first=90) != 0.0).all()
    assert one.count(STATUS) == 0
