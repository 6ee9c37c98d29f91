"""One drive, written in every format that is read: the same doubles, the same clock."""

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

Columns = Mapping[str, np.ndarray]
# By name of a column: its unit, and the message and field that hold it in a bag.
UNITS = {"v_x": "m/s", "v_y": "m/s", "r": "rad/s", "delta_f": "rad", "a_y": "m/s^2"}
FIRST_NS = 1_700_000_000_000_000_000  # of a bag: ns since 1970
MAT73_HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: then HDF5 schema 1.00 ."


def write_mat5(path, t, columns):
    """Vectors and their time, as `save` writes them."""
    import scipy.io

    scipy.io.savemat(
        path, {"t": t[:, None], **{k: v[:, None] for k, v in columns.items()}}, do_compression=True
    )
    return path


def write_mat73(path, tree):
    """Structs of vectors, as `save -v7.3` writes them: HDF5 behind a header of 512 bytes."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        _fill(file, tree)
    with path.open("r+b") as file:
        file.write(MAT73_HEADER.ljust(124) + b"\x00\x02IM")
    return path


def _fill(group, tree):
    for name, value in tree.items():
        if isinstance(value, Mapping):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            _fill(inner, value)
        elif isinstance(value, str):
            codes = np.array([[ord(one)] for one in value], dtype="u2")
            group[name] = codes
            group[name].attrs["MATLAB_class"] = np.bytes_("char")
        elif isinstance(value, list):
            _fill_cell(group, name, value)
        else:
            array = np.atleast_2d(np.asarray(value))
            group[name] = array if np.asarray(value).ndim == 1 else array.T
            group[name].attrs["MATLAB_class"] = np.bytes_(
                {"float64": "double", "float32": "single"}.get(array.dtype.name, array.dtype.name)
            )


def _fill_cell(group, name, cells):
    """A cell array: references to what lies in #refs#."""
    import h5py

    refs = group.file.require_group("#refs#")
    first = len(refs)
    names = [f"{first + k}" for k in range(len(cells))]
    _fill(refs, dict(zip(names, cells, strict=True)))
    group.create_dataset(name, (len(cells), 1), dtype=h5py.ref_dtype)
    for k, one in enumerate(names):
        group[name][k, 0] = refs[one].ref
    group[name].attrs["MATLAB_class"] = np.bytes_("cell")


def write_mdf(path, t, columns, version="4.10"):
    """One group of channels."""
    from asammdf import MDF, Signal

    with MDF(version=version) as file:
        file.append(
            [Signal(v, t, name=k, unit=UNITS.get(k, "")) for k, v in columns.items()],
            comment="drive",
            common_timebase=True,
        )
        file.save(path, overwrite=True, compression=2 if version >= "4" else 0)
    return path


def write_bag(path, t, columns, storage="sqlite3"):
    """Odometry, an IMU and a steering angle; in a folder, by "sqlite3" or "mcap"."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[storage]
    ns = FIRST_NS + np.round(t * 1e9).astype(np.int64)
    with Writer(path, version=9, storage_plugin=plugin) as bag:
        odometry, imu, steering = (
            bag.add_connection(topic, kind, typestore=store)
            for topic, kind in (
                ("/odom", "nav_msgs/msg/Odometry"),
                ("/imu", "sensor_msgs/msg/Imu"),
                ("/steering", "std_msgs/msg/Float64"),
            )
        )
        for k, time in enumerate(ns.tolist()):
            head = header(store, time)
            one = {name: float(values[k]) for name, values in columns.items()}
            for connection, message in (
                (odometry, _odometry(store, head, one)),
                (imu, _imu(store, head, one)),
                (steering, store.types["std_msgs/msg/Float64"](one["delta_f"])),
            ):
                raw = store.serialize_cdr(message, message.__msgtype__)
                bag.write(connection, time, raw)
    return path


# What the columns are in such a bag.
IN_BAG = {
    "v_x": "/odom/twist.twist.linear.x",
    "v_y": "/odom/twist.twist.linear.y",
    "r": "/odom/twist.twist.angular.z",
    "delta_f": "/steering/data",
    "a_y": "/imu/linear_acceleration.y",
}


def header(store, ns, frame="base_link"):
    time = store.types["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
    return store.types["std_msgs/msg/Header"](time, frame)


def _vector(store, x=0.0, y=0.0, z=0.0):
    return store.types["geometry_msgs/msg/Vector3"](x, y, z)


def _odometry(store, header, one):
    kinds = store.types
    rest = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    pose = kinds["geometry_msgs/msg/Pose"](kinds["geometry_msgs/msg/Point"](1.0, 2.0, 3.0), rest)
    twist = kinds["geometry_msgs/msg/Twist"](
        _vector(store, one["v_x"], one["v_y"]), _vector(store, z=one["r"])
    )
    none = np.zeros(36)
    return kinds["nav_msgs/msg/Odometry"](
        header,
        "base_link",
        kinds["geometry_msgs/msg/PoseWithCovariance"](pose, none),
        kinds["geometry_msgs/msg/TwistWithCovariance"](twist, none),
    )


def _imu(store, header, one):
    kinds, none = store.types, np.zeros(9)
    rest = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    return kinds["sensor_msgs/msg/Imu"](
        header, rest, none, _vector(store, z=one["r"]), none, _vector(store, y=one["a_y"]), none
    )


# A frame of a double for each column: no factor rounds it.
DBC = 'VERSION ""\n\nBU_: Car\n' + "".join(
    f'\nBO_ {256 + k} Frame_{name}: 8 Car\n SG_ {name} : 0|64@1- (1,0) [0|0] "{unit}" Car\n'
    for k, (name, unit) in enumerate(UNITS.items())
)
DBC += "".join(f"\nSIG_VALTYPE_ {256 + k} {name} : 2;" for k, name in enumerate(UNITS)) + "\n"


def write_can(path, t, columns):
    """One frame a column and sample; ".asc", ".blf", ".log" (candump) or ".trc". The DBC: `DBC`."""
    import struct

    import can

    with can.Logger(str(path)) as log:
        for k, time in enumerate(t.tolist()):
            for number, name in enumerate(UNITS):
                if name in columns:
                    log.on_message_received(
                        can.Message(
                            timestamp=FIRST_NS / 1e9 + time,
                            arbitration_id=256 + number,
                            is_extended_id=False,
                            data=struct.pack("<d", columns[name][k]),
                        )
                    )
    path.with_suffix(".dbc").write_text(DBC)
    return path


def write_mdf_bus(path, t, columns, apart=False):
    """The same frames as MDF4 that logs a bus; apart: later ones first, and remote frames."""
    from asammdf import MDF, Source

    order = [name for name in UNITS if name in columns]
    count = t.size * len(order)
    kind = [("CAN_DataFrame.BusChannel", "u1"), ("CAN_DataFrame.ID", "<u4")]
    kind += [("CAN_DataFrame.IDE", "u1"), ("CAN_DataFrame.DLC", "u1")]
    kind += [("CAN_DataFrame.DataLength", "u1"), ("CAN_DataFrame.DataBytes", "u1", (8,))]
    frames = np.zeros(count, dtype=kind)
    frames["CAN_DataFrame.BusChannel"] = 1
    frames["CAN_DataFrame.ID"] = np.tile([256 + list(UNITS).index(one) for one in order], t.size)
    frames["CAN_DataFrame.DLC"] = frames["CAN_DataFrame.DataLength"] = 8
    values = np.column_stack([columns[one] for one in order]).reshape(-1)
    frames["CAN_DataFrame.DataBytes"] = values.view("u1").reshape(count, 8)
    stamps = np.repeat(t, len(order))
    bus = Source(name="CAN", path="CAN", comment="", source_type=2, bus_type=2)
    half = count // 2
    parts = [slice(half, None), slice(0, half)] if apart else [slice(None)]
    with MDF(version="4.10") as file:
        for part in parts:
            _append(file, frames[part], stamps[part], "CAN_DataFrame", bus)
        if apart:
            for name, size in (("CAN_RemoteFrame", 7), ("CAN_ErrorFrame", 4), ("LIN_Frame", 3)):
                no_data = np.zeros(
                    size, dtype=[(f"{name}.BusChannel", "u1"), (f"{name}.ID", "<u4")]
                )
                _append(file, no_data, t[:size], name, bus)
        file.save(path, overwrite=True)
    path.with_suffix(".dbc").write_text(DBC)
    return path


def _append(file, frames, t, name, bus):
    """One group of frames of a bus."""
    from asammdf import Signal

    file.append(Signal(frames, t, name=name, source=bus), acq_source=bus, common_timebase=True)
    group = file.groups[-1]
    group.channel_group.flags |= 2 | 4
    for channel in group.channels:
        channel.flags |= 1 << 10


class Written(NamedTuple):
    """A drive in a file: the file, its DBC or None, and by column the name of its channel."""

    path: Path
    dbc: Path | None
    names: dict[str, str]

    @property
    def channels(self):
        return list(self.names.values())


# By format: how a drive is written, into a folder. All of them hold the same doubles.
def _named(path, columns, pattern="{}", dbc=False):
    names = {name: pattern.format(name) for name in columns}
    return Written(path, path.with_suffix(".dbc") if dbc else None, names)


def _csv(folder, t, columns):
    rows = np.column_stack([t, *columns.values()]).tolist()
    text = ",".join(["t", *columns]) + "\n"
    text += "".join(",".join(map(repr, row)) + "\n" for row in rows)
    path = folder / "drive.csv"
    path.write_text(text)
    return _named(path, columns)


def _parquet(folder, t, columns):
    import pyarrow
    import pyarrow.parquet

    path = folder / "drive.parquet"
    fields = [
        pyarrow.field(name, pyarrow.float64(), metadata={"unit": UNITS.get(name, "s")})
        for name in ("t", *columns)
    ]
    table = pyarrow.table([t, *columns.values()], schema=pyarrow.schema(fields))
    pyarrow.parquet.write_table(table, path)
    return _named(path, columns)


def _in_bag(path, columns):
    return Written(path, None, {name: IN_BAG[name] for name in columns})


def _frames(ending):
    return lambda f, t, c: _named(write_can(f / f"drive.{ending}", t, c), c, "Frame_{0}.{0}", True)


FORMATS: dict[str, Callable[[Path, np.ndarray, Columns], Written]] = {
    "CSV": _csv,
    "Parquet": _parquet,
    "MATLAB": lambda f, t, c: _named(write_mat5(f / "drive.mat", t, c), c),
    "MATLAB 7.3": lambda f, t, c: _named(
        write_mat73(f / "drive.mat", {"log": {"t": t, **c, "units": UNITS}}), c, "log.{}"
    ),
    "MDF4": lambda f, t, c: _named(write_mdf(f / "drive.mf4", t, c), c),
    "MDF3": lambda f, t, c: _named(write_mdf(f / "drive.mdf", t, c, "3.30"), c),
    "ROS 2 bag": lambda f, t, c: _in_bag(write_bag(f / "drive", t, c), c),
    "db3": lambda f, t, c: _in_bag(write_bag(f / "drive", t, c) / "drive.db3", c),
    "MCAP": lambda f, t, c: _in_bag(write_bag(f / "drive", t, c, "mcap") / "drive.mcap", c),
    "CAN ASC": _frames("asc"),
    "CAN BLF": _frames("blf"),
    "CAN candump": _frames("log"),
    "CAN TRC": _frames("trc"),
    "CAN MDF4": lambda f, t, c: _named(
        write_mdf_bus(f / "drive.mf4", t, c), c, "Frame_{0}.{0}", True
    ),
}


def write(format, folder, t, columns):
    """A drive in a format; what the libraries that write warn of is theirs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return FORMATS[format](folder, t, columns)
