"""CAN logs: every signal as cantools decodes it; frames that are no signals are counted."""

import struct
import warnings

import numpy as np
import pytest

from models.logs.can import _group_of, _raw_values, _values_of, read_dbc, reader_of
from models.logs.door import open_log
from tests.models.logs.conftest import channel_of, refusal
from tests.models.logs.drive_in_every_format import DBC, write_can, write_mdf_bus

can = pytest.importorskip("can")
cantools = pytest.importorskip("cantools")

CAR = """VERSION ""

BU_: Car

BO_ 100 Steering: 8 Car
 SG_ Angle : 0|16@1- (0.1,0) [-780|780] "°" Car
 SG_ Rate : 23|16@0- (0.05,-1.5) [0|0] "deg/s" Car
 SG_ Counter : 60|4@1+ (1,0) [0|15] "" Car

BO_ 2566852608 Extended: 4 Car
 SG_ Speed : 0|16@1+ (0.01,0) [0|655] "km/h" Car

BO_ 200 Muxed: 8 Car
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" Car
 SG_ First m0 : 8|16@1- (0.5,0) [0|0] "m" Car
 SG_ Second m1 : 8|16@1- (2,1) [0|0] "s" Car

VAL_ 100 Angle 32767 "SNA" 32766 "Init_Error" 1 "one step" ;
"""


def write(path, messages, **how):
    with can.Logger(str(path), **how) as log:
        for time, identifier, data, more in messages:
            about = {"timestamp": time, "arbitration_id": identifier, "data": data, **more}
            log.on_message_received(can.Message(is_extended_id=identifier > 0x7FF, **about))
    return path


def dbc(folder, text=CAR):
    path = folder / "car.dbc"
    path.write_bytes(text.encode("cp1252"))
    return path


def random_signal(rng, number):
    """A signal of any place, size, byte order and sign in a frame of 8 bytes."""
    little, floating = bool(rng.integers(2)), rng.random() < 0.2
    length = int(rng.choice([32, 64])) if floating else int(rng.integers(1, 65))
    first = int(rng.integers(0, 64 - length + 1))
    start = first if little else 8 * (first // 8) + 7 - first % 8
    sign = "-" if floating or rng.integers(2) else "+"
    factor, offset = rng.choice([1, 0.01, -2.5]), rng.choice([0, 3, -0.75])
    text = f"\nBO_ {number} F{number}: 8 Car\n SG_ S : {start}|{length}@{int(little)}{sign} "
    text += f'({factor},{offset}) [0|0] "" Car\n'
    return text, f"\nSIG_VALTYPE_ {number} S : {length // 32};" if floating else ""


def test_signals_of_any_place_and_kind_are_those_that_cantools_decodes():
    rng = np.random.default_rng(11)
    parts = [random_signal(rng, k) for k in range(1, 300)]
    text = 'VERSION ""\n\nBU_: Car\n' + "".join(a for a, _ in parts) + "".join(b for _, b in parts)
    base = cantools.database.load_string(text + "\n", "dbc", strict=False)
    data = rng.integers(0, 256, (20, 8)).astype(np.uint8)
    for message in base.messages:
        (signal,) = message.signals
        there = [message.decode(bytes(row), scaling=False)["S"] for row in data]
        ours = _raw_values(data, signal)
        for one, other in zip(ours.tolist(), there, strict=True):
            assert one == other or (np.isnan(one) and np.isnan(other)), signal
        scaled = [float(message.decode(bytes(row))["S"]) for row in data]
        # Integers of 64 bits lose their last digits on the way to a double.
        with np.errstate(invalid="ignore"):  # floats of any bits
            values = _values_of(data, signal)
            alone = [reader_of(message, signal)(row.tobytes()) for row in data]
        assert np.allclose(values, scaled, rtol=1e-14, atol=1e-14, equal_nan=True)
        assert np.array_equal(values, alone, equal_nan=True)


def steering(k):
    return struct.pack("<h", k) + struct.pack(">h", 2 * k) + b"\0\0\0" + bytes([(k % 16) << 4])


def car_log(path):
    messages = []
    for k in range(30):
        t = 1.7e9 + k * 0.02
        messages.append((t, 100, steering(k), {}))
        messages.append((t + 0.001, 0x18FF1000, struct.pack("<HH", 100 * k, 0), {}))
        messages.append((t + 0.002, 200, bytes([k % 2]) + struct.pack("<h", k) + bytes(5), {}))
        messages.append((t + 0.003, 300, b"\1\2", {}))
    messages.append((1.7e9 + 1, 100, b"\0\0", {}))
    messages.append((1.7e9 + 1, 100, b"", {"is_remote_frame": True, "dlc": 8}))
    return write(path, messages)


@pytest.mark.parametrize("ending", ["asc", "blf", "log"])
def test_a_dbc_tells_the_signals_their_units_and_which_frames_hold_them(ending, tmp_path):
    log = open_log(car_log(tmp_path / f"log.{ending}"), dbc(tmp_path))
    listed = {one.name: (one.unit, one.samples, round(one.rate)) for one in log.listed()}
    assert listed == {
        "Steering.Angle": ("°", 30, 50), "Steering.Rate": ("deg/s", 30, 50),
        "Steering.Counter": ("", 30, 50), "Extended.Speed": ("km/h", 30, 50),
        "Muxed.Page": ("", 30, 50), "Muxed.First": ("m", 15, 25), "Muxed.Second": ("s", 15, 25),
    }  # fmt: skip
    assert set(log.notes) == {
        "30 unknown frames are not read",
        "1 cut short frames are not read",
        "1 error and remote frames are not read",
    }
    k = np.arange(30)
    angle, rate, speed, second = log.read(
        ["Steering.Angle", "Steering.Rate", "Extended.Speed", "Muxed.Second"]
    )
    assert np.allclose(angle.values, 0.1 * k, rtol=0, atol=1e-12)
    assert np.allclose(rate.values, 0.1 * k - 1.5, rtol=0, atol=1e-12)
    assert np.allclose(speed.values, k, rtol=0, atol=1e-12)
    assert np.array_equal(second.values, 2.0 * k[1::2] + 1)
    assert np.allclose(angle.t, 0.02 * k, rtol=0, atol=1e-9)
    assert np.allclose(speed.t, 0.02 * k + 0.001, rtol=0, atol=1e-9)
    assert np.allclose(second.t, 0.02 * k[1::2] + 0.002, rtol=0, atol=1e-9)


def test_values_that_the_dbc_names_as_no_number_are_nan(tmp_path):
    raw = [5, 32767, 32766, 1, -5]
    messages = [(k * 0.01, 100, struct.pack("<h", one) + bytes(6), {}) for k, one in enumerate(raw)]
    log = open_log(write(tmp_path / "log.blf", messages), dbc(tmp_path))
    values = channel_of(log, "Steering.Angle").values
    assert np.allclose(values, [0.5, np.nan, np.nan, 0.1, -0.5], equal_nan=True)
    message = read_dbc(tmp_path / "car.dbc").messages[100]
    read = reader_of(message, message.get_signal_by_name("Angle"))
    assert np.array_equal(values, [read(data) for *_, data, _ in messages], equal_nan=True)


def test_the_same_frame_on_two_buses_is_two_channels(tmp_path):
    messages = []
    for k in range(20):
        messages += [(0.01 * k, 100, steering(k + 5 * bus), {"channel": bus}) for bus in (0, 1)]
    log = open_log(write(tmp_path / "log.blf", messages), dbc(tmp_path))
    names = [one.name for one in log.listed() if "Angle" in one.name]
    assert names == ["bus 0/Steering.Angle", "bus 1/Steering.Angle"]
    one, two = log.read(names)
    assert np.allclose(two.values - one.values, 0.5)


def test_frames_of_can_fd_are_read(tmp_path):
    text = 'VERSION ""\n\nBU_: Car\n\nBO_ 100 Long: 64 Car\n SG_ V : 448|64@1- (1,0) [0|0] "" Car\n'
    text += "\nSIG_VALTYPE_ 100 V : 2;\n"
    messages = [
        (0.01 * k, 100, bytes(56) + struct.pack("<d", k / 3), {"is_fd": True}) for k in range(20)
    ]
    log = open_log(write(tmp_path / "log.blf", messages), dbc(tmp_path, text))
    assert np.array_equal(channel_of(log, "Long.V").values, np.arange(20) / 3)


def bus(folder, *drive, **more):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return write_mdf_bus(folder / "log.mf4", *drive, **more)


def test_frames_of_a_bus_in_mdf_are_told_apart_from_channels(tmp_path, drive):
    path = bus(tmp_path, *drive)
    assert 'frames of a bus need a DBC, in the [file] of log.toml dbc = "car.dbc"' in refusal(path)
    assert open_log(path, path.with_suffix(".dbc")).format == "CAN MDF4"


def test_frames_of_several_groups_are_in_order_and_those_without_data_counted(tmp_path, drive):
    t, columns = drive
    path = bus(tmp_path, t, columns, apart=True)
    log = open_log(path, path.with_suffix(".dbc"))
    (r,) = log.read(["Frame_r.r"])
    assert np.array_equal(r.t, t) and np.array_equal(r.values, columns["r"])
    assert set(log.notes) == {
        "11 error and remote frames are not read",
        "3 other frames are not read",
    }


def test_a_dbc_that_knows_none_of_the_frames_is_refused(tmp_path, drive):
    path = write_can(tmp_path / "log.asc", *drive)
    text = refusal(path, dbc(tmp_path))
    assert "holds no frame that" in text and text.endswith("1500 unknown frames are not read")


@pytest.mark.parametrize("content", [b"", b"hello", b"\0" * 100, DBC.encode()[:-40] + b"BO_ x"])
def test_a_dbc_that_is_none_is_refused(content, tmp_path, drive):
    path = write_can(tmp_path / "log.blf", *drive)
    base = tmp_path / "bad.dbc"
    base.write_bytes(content)
    assert refusal(path, base).startswith(f"{base}: is not a DBC file")
    assert refusal(path, tmp_path / "no.dbc") == f"{tmp_path / 'no.dbc'}: there is no such file"


def test_a_dbc_is_for_logs_of_a_bus(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,v\n0,1\n1,2\n")
    assert "is no CAN log" in refusal(path, dbc(tmp_path))


def test_times_that_count_from_the_frame_before_are_refused(tmp_path, drive):
    path = write_can(tmp_path / "log.asc", *drive)
    path.write_text(path.read_text().replace("timestamps absolute", "timestamps relative"))
    assert "save it with timestamps absolute" in refusal(path, path.with_suffix(".dbc"))


def test_a_blf_that_was_cut_off_is_refused(tmp_path, drive):
    path = write_can(tmp_path / "log.blf", *drive)
    path.write_bytes(path.read_bytes()[:-10])
    assert "is cut off, it has" in refusal(path, path.with_suffix(".dbc"))


@pytest.mark.parametrize("level", [0, 6])
def test_containers_may_be_compressed_or_not(level, tmp_path, monkeypatch):
    messages = [(0.01 * k, 100, steering(k % 100), {}) for k in range(2000)]
    path = write(tmp_path / "log.blf", messages, compression_level=level)
    monkeypatch.setenv("TIREID_LIMITS", "block=1")
    (angle,) = open_log(path, dbc(tmp_path)).read(["Steering.Angle"])
    assert angle.values.size == 2000
    monkeypatch.setenv("TIREID_LIMITS", "block=0.05")
    assert "megabytes of a block must be at most 0.05" in refusal(path, dbc(tmp_path))


@pytest.mark.parametrize(
    ("place", "fault"),
    [
        ("8|16@1-", "lies beyond its frame of 2 bytes"),
        ("0|72@1-", "must have 1 to 64 bits, it has 72"),
        ("0|8@1-", "must have 16, 32 or 64 bits, it has 8"),
    ],
)
@pytest.mark.parametrize("selects", [False, True])
def test_a_fault_of_the_dbc_is_told_of_the_dbc(place, fault, selects, tmp_path):
    text = 'VERSION ""\n\nBU_: Car\n\nBO_ 100 F: 2 Car\n'
    text += f' SG_ V {"M " * selects}: {place} (1,0) [0|0] "" Car\n'
    text += f' SG_ W {"m0 " * selects}: 0|8@1- (1,0) [0|0] "" Car\n'
    text += "\nSIG_VALTYPE_ 100 V : 2;\n" if "16, 32" in fault else ""
    base = dbc(tmp_path, text)
    path = write(tmp_path / "log.blf", [(0.01 * k, 100, bytes(2), {}) for k in range(20)])
    assert refusal(path, base) == f"{base}: frame F: signal V {fault}"
    if not selects:
        assert channel_of(open_log(path, base), "F.W").values.size == 20


GROUP = 'BO_ 2566916606 ESP: 4 Car\n SG_ YawRate : 0|16@1- (0.001,0) [-4|4] "rad/s" Car\n'
J1939 = """BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "ProtocolType" "";
BA_ "ProtocolType" "J1939";
"""


def of_a_truck(folder, more="", sender=0xFE):
    message = GROUP.replace("2566916606", str(0x98F00900 | sender))
    return dbc(folder, f'VERSION ""\n\nBU_: Car\n\n{message}{more}')


def frames(count, identifier):
    return [(10.0 + 0.01 * k, "can0", identifier, struct.pack("<hh", k, 0)) for k in range(count)]


@pytest.mark.parametrize("senders", [[0x18F0093E], [0x08F009FE], [0x18F0093E, 0x18F00917]])
@pytest.mark.parametrize("told", ["", J1939])
def test_frames_of_j1939_are_known_by_their_parameter_group(senders, told, tmp_path):
    """0x18F009FE in the database: priority and sender differ in the log."""
    base = of_a_truck(tmp_path, told)
    path = tmp_path / "bus.log"
    lines = [row for one in senders for row in frames(30, one)]
    path.write_text("".join(f"({t:.6f}) {b} {i:08X}#{d.hex().upper()}\n" for t, b, i, d in lines))
    log = open_log(path, base)
    assert len(log.listed()) == len(senders)
    if len(senders) == 2:
        assert [one.name for one in log.listed()] == [
            "bus can0 from 3E/ESP.YawRate",
            "bus can0 from 17/ESP.YawRate",
        ]
    for one in log.read([one.name for one in log.listed()]):
        np.testing.assert_allclose(one.values, 0.001 * np.arange(30))


def test_a_parameter_group_with_a_receiver_is_known_whoever_receives():
    assert _group_of(0x18EA0BFE) == _group_of(0x0CEAFF21) == 0xEA00
    assert _group_of(0x18F0093E) == 0xF009 and _group_of(0x19F0093E) == 0x1F009


def test_a_long_identifier_of_no_j1939_is_not_taken_for_another(tmp_path):
    base = of_a_truck(tmp_path, sender=0x01)
    path = tmp_path / "bus.log"
    path.write_text("".join(f"({t:.6f}) {b} 18F0093E#{d.hex()}\n" for t, b, _, d in frames(9, 0)))
    assert "9 unknown frames" in refusal(path, base)


TEXTS = {
    "candump": lambda t, i, d: f" ({t:.6f})  can0  {i:08X}   [{len(d)}]  {d.hex(' ').upper()}",
    "candump -x": lambda t, i, d: f" ({t:.6f})  can0  RX - -  {i:08X}   [{len(d)}]  {d.hex(' ')}",
    "candump -tA": lambda t, i, d: (
        f" (2025-04-04 18:10:{t:09.6f})  can0  {i:08X}   [{len(d)}]  {d.hex(' ')}"
    ),
    "SavvyCAN": lambda t, i, d: (
        f"{t * 1e6:.0f},{i:08X},true,Rx,0,{len(d)},{','.join(d.hex(' ').upper().split())},,,,,"
    ),
    "bytes from 0": lambda t, i, d: (
        f"{t:.4f},{i:#x},{len(d)},{','.join([*d.hex(' ').split(), *(8 - len(d)) * ['']])}"
    ),
    "cabana": lambda t, i, d: f"{t:.4f},{i:#x},0,0x{d.hex()}",
    "cabana, decimal": lambda t, i, d: f"{t:.4f},{i},0,{d.hex()}",
}
HEADERS = {
    "SavvyCAN": "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n",
    "bytes from 0": "Time,ID,DLC,D0,D1,D2,D3,D4,D5,D6,D7\n",
    "cabana": "time,addr,bus,data\n",
    "cabana, decimal": "time,addr,bus,data\n",
}


@pytest.mark.parametrize("kind", TEXTS)
def test_frames_in_text_are_read_as_tools_print_them(kind, tmp_path):
    base = of_a_truck(tmp_path)
    path = tmp_path / ("bus.csv" if kind in HEADERS else "bus.log")
    rows = [TEXTS[kind](t, i, d) for t, _, i, d in frames(30, 0x18F0093E)]
    path.write_text(HEADERS.get(kind, "") + "\n".join([*rows, ""]))
    assert "give the DBC" in refusal(path)
    (channel,) = (log := open_log(path, base)).read(["ESP.YawRate"])
    np.testing.assert_allclose(channel.values, 0.001 * np.arange(30))
    np.testing.assert_allclose(channel.t - channel.t[0], 0.01 * np.arange(30), atol=1e-6)
    assert log.format.startswith("CAN ")


def test_a_line_without_time_and_a_row_that_is_no_frame_are_refused(tmp_path):
    base = dbc(tmp_path)
    path = tmp_path / "bus.log"
    path.write_text("  can0  123   [2]  01 02\n" * 9)
    assert "line 1 has no time in front" in refusal(path, base)
    path.write_text("".join(f" ({0.01:.6f})  can0  123   [2]  01 02\n" for _ in range(9)) + "x\n")
    assert "line 10" in refusal(path, base)
    path.write_text("time,addr,bus,data\n0.1,0x1d2,0,0x1122\n0.2,0x1d2,0,zz\n")
    assert "line 3 must hold a frame" in refusal(path, base)


def test_a_table_with_an_id_and_no_frames_is_a_table(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,id,data,r\n" + "".join(f"{k / 100},7,{k}.25,0.1\n" for k in range(30)))
    assert open_log(path).format == "CSV"
