"""ROS 2 bags: messages of cars, types of their own, clocks; against what rosbags deserializes."""

import sqlite3

import numpy as np
import pytest

from models.logs.bag import _KNOWN
from models.logs.door import open_log
from tests.models.logs.conftest import channel_of, refusal
from tests.models.logs.drive_in_every_format import FIRST_NS, header, write_bag

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")
STEP = 10_000_000  # ns
STORAGES = {"sqlite3": rosbag2.StoragePlugin.SQLITE3, "mcap": rosbag2.StoragePlugin.MCAP}


MIXED = """
bool ready
uint8 mode
string word
int16 small
float64[] many
float32 after
Inner inner
Inner[2] pair
Inner[] more
string[] words
uint64 large
int8 last
"""
INNER = "float64 x\nstring name\nint32 n\nuint16[3] codes"
SCALARS = ("mode", "small", "after", "inner.x", "inner.n", "large", "last")
# Types of a distribution, those that cars use, and more by their definitions.
STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
MINE = {"Inner": INNER, "Mixed": MIXED, "Loop": "float64 x"}
for kind, text in (_KNOWN | {f"my_msgs/msg/{name}": one for name, one in MINE.items()}).items():
    STORE.register(typesys.get_types_from_msg(text, kind))


def write(path, topics, storage="sqlite3", mode=None):
    """Topics: name -> (type, [(received in ns, message)]); in the order of their times."""
    bag = rosbag2.Writer(path, version=9, storage_plugin=STORAGES[storage])
    if mode is not None:
        bag.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with bag:
        rows = []
        for name, (kind, messages) in topics.items():
            connection = bag.add_connection(name, kind, typestore=STORE)
            rows += [(time, connection, STORE.serialize_cdr(one, kind)) for time, one in messages]
        for time, connection, raw in sorted(rows, key=lambda row: row[0]):
            bag.write(connection, time, raw)
    return path


def car_topics(count=50):
    """Every message that cars tell their motion by, with numbers that count up."""

    def of(kind, *values):
        package, _, name = kind.partition("/")
        return STORE.types[f"{package}/msg/{name}"](*values)

    def pair(kind, one, two):
        vectors = (of("geometry_msgs/Vector3", *values) for values in (one, two))
        return of(f"geometry_msgs/{kind}", *vectors)

    def steered(x):
        return x / 8, 0, x, 0, 0

    rest = (0, 0, 0)
    covariant = "geometry_msgs/TwistWithCovariance"
    fields = {  # after the header, by topic and type
        ("/twist", "geometry_msgs/TwistStamped"): lambda x: [
            pair("Twist", (x, x + 1, 0), (0, 0, x + 2))
        ],
        ("/estimate", f"{covariant}Stamped"): lambda x: [
            of(covariant, pair("Twist", (x, 0, 0), rest), np.zeros(36))
        ],
        ("/accel", "geometry_msgs/AccelStamped"): lambda x: [pair("Accel", (0, x, 0), rest)],
        ("/drive", "ackermann_msgs/AckermannDriveStamped"): lambda x: [
            of("ackermann_msgs/AckermannDrive", *steered(x))
        ],
        ("/plain", "ackermann_msgs/AckermannDrive"): steered,
        ("/velocity", "autoware_vehicle_msgs/VelocityReport"): lambda x: [x, x / 2, x / 4],
    }
    for package in ("autoware_vehicle_msgs", "autoware_auto_vehicle_msgs"):
        fields[f"/{package}/steer", f"{package}/SteeringReport"] = lambda x: [x / 4]
    topics = {}
    for (name, kind), build in fields.items():
        messages = []
        for k in range(count):
            ns = FIRST_NS + k * STEP
            h = header(STORE, ns)
            begin = [] if name == "/plain" else [h.stamp if name.endswith("/steer") else h]
            messages.append((ns, of(kind, *begin, *build(float(k)))))
        topics[name] = kind.replace("/", "/msg/"), messages
    return topics


WANTED = {
    "/twist/twist.linear.y": ("m/s", 1.0, 1.0),
    "/twist/twist.angular.z": ("rad/s", 1.0, 2.0),
    "/estimate/twist.twist.linear.x": ("m/s", 1.0, 0.0),
    "/accel/accel.linear.y": ("m/s^2", 1.0, 0.0),
    "/drive/drive.steering_angle": ("rad", 0.125, 0.0),
    "/drive/drive.speed": ("m/s", 1.0, 0.0),
    "/plain/steering_angle": ("rad", 0.125, 0.0),
    "/autoware_vehicle_msgs/steer/steering_tire_angle": ("rad", 0.25, 0.0),
    "/autoware_auto_vehicle_msgs/steer/steering_tire_angle": ("rad", 0.25, 0.0),
    "/velocity/lateral_velocity": ("m/s", 0.5, 0.0),
    "/velocity/heading_rate": ("rad/s", 0.25, 0.0),
}


def old(path, folder):
    """The database of a bag as distributions before Iron wrote it: without definitions."""
    one = folder / "old.db3"
    with sqlite3.connect(one) as base:
        base.execute("ATTACH ? AS bag", [str(next(path.glob("*.db3")))])
        for table, words in (
            ("topics", "id, name, type, serialization_format, offered_qos_profiles"),
            ("messages", "id, topic_id, timestamp, data"),
        ):
            base.execute(f"CREATE TABLE {table} AS SELECT {words} FROM bag.{table}")
    base.close()
    return one


@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "old"])
def test_messages_of_cars_are_read_with_their_units(kind, tmp_path):
    path = write(tmp_path / "bag", car_topics(), "mcap" if kind == "mcap" else "sqlite3")
    log = open_log(old(path, tmp_path) if kind == "old" else path)
    units = {one.name: one.unit for one in log.listed()}
    k = np.arange(50.0)
    for name, channel in zip(WANTED, log.read(list(WANTED)), strict=True):
        unit, factor, offset = WANTED[name]
        assert units[name] == channel.unit == unit
        assert np.array_equal(channel.values, k * factor + offset), name
        assert np.array_equal(channel.t, np.arange(50) / 100)
    assert log.notes == ("no stamp in the message, its clock is when the bag received it: /plain",)
    assert not any("covariance" in name or "stamp" in name for name in units)


def test_messages_that_came_in_another_order_are_sorted_by_their_stamps(tmp_path):
    kind, messages = car_topics()["/twist"]
    (early, first), (late, second) = messages[10:12]
    messages[10:12] = [(early, second), (late, first)]
    log = open_log(write(tmp_path / "bag", {"/twist": (kind, messages)}))
    (channel,) = log.read(["/twist/twist.linear.y"])
    assert np.array_equal(channel.t, np.arange(50) / 100)
    assert np.array_equal(channel.values, np.arange(50) + 1.0)
    assert log.notes == ("the clock of /twist: samples out of order are sorted: 1",)


def random_message(rng):
    def word():
        return "x" * int(rng.integers(0, 9))

    def inner():
        return STORE.types["my_msgs/msg/Inner"](
            float(rng.standard_normal()),
            word(),
            int(rng.integers(-(2**31), 2**31)),
            rng.integers(0, 2**16, 3).astype(np.uint16),
        )

    return STORE.types["my_msgs/msg/Mixed"](
        bool(rng.integers(2)),
        int(rng.integers(256)),
        word(),
        int(rng.integers(-(2**15), 2**15)),
        rng.standard_normal(int(rng.integers(0, 4))),
        float(np.float32(rng.standard_normal())),
        inner(),
        [inner(), inner()],
        [inner() for _ in range(int(rng.integers(0, 3)))],
        [word() for _ in range(int(rng.integers(0, 3)))],
        int(rng.integers(2**53)),
        int(rng.integers(-128, 128)),
    )


def test_messages_of_any_lengths_are_read_as_rosbags_reads_them(tmp_path):
    rng = np.random.default_rng(2)
    messages = [(FIRST_NS + k * STEP, random_message(rng)) for k in range(400)]
    path = write(tmp_path / "bag", {"/a": ("my_msgs/msg/Mixed", messages)}, "mcap")
    log = open_log(path)
    assert tuple(one.name for one in log.listed()) == tuple(f"/a/{one}" for one in SCALARS)
    for name, channel in zip(SCALARS, log.read([f"/a/{one}" for one in SCALARS]), strict=True):
        expected = []
        for _, message in messages:
            for part in name.split("."):
                message = getattr(message, part)
            expected.append(float(message))
        assert np.array_equal(channel.values, expected), name


def test_messages_of_the_other_byte_order_are_read(tmp_path):
    rng = np.random.default_rng(2)
    message = random_message(rng)
    kind = "my_msgs/msg/Mixed"
    with rosbag2.Writer(tmp_path / "bag", version=9) as bag:
        connection = bag.add_connection("/a", kind, typestore=STORE)
        for k in range(20):
            raw = STORE.serialize_cdr(message, kind, little_endian=k % 2 == 0)
            bag.write(connection, FIRST_NS + k * STEP, raw)
    large, x = open_log(tmp_path / "bag").read(["/a/large", "/a/inner.x"])
    assert set(large.values) == {float(message.large)}
    assert set(x.values) == {message.inner.x}


def test_a_type_without_definition_is_named_and_others_are_read(tmp_path):
    topics = car_topics()
    topics["/mixed"] = (
        "my_msgs/msg/Mixed",
        [(FIRST_NS, random_message(np.random.default_rng(1)))],
    )
    path = write(tmp_path / "bag", {name: topics[name] for name in ("/twist", "/mixed")})
    log = open_log(old(path, tmp_path))
    assert {one.name.split("/")[1] for one in log.listed()} == {"twist"}
    assert log.notes == ("not read: /mixed (the type my_msgs/msg/Mixed has no definition)",)


def test_stamps_that_were_not_set_give_way_to_the_time_of_the_bag(tmp_path):
    kind, messages = car_topics()["/velocity"]
    for _, message in messages:
        message.header.stamp.sec = message.header.stamp.nanosec = 0
    log = open_log(write(tmp_path / "bag", {"/velocity": (kind, messages)}))
    assert "its clock is when the bag received it: /velocity" in log.notes[0]
    assert np.array_equal(channel_of(log, "/velocity/heading_rate").t, np.arange(50) / 100)


@pytest.mark.parametrize("of", ["a drive", "a simulation"])
def test_the_stamp_is_the_clock_and_not_when_the_bag_received_the_message(of, tmp_path):
    topics = {name: car_topics()[name] for name in ("/twist", "/plain")}
    late = []
    for k, (time, one) in enumerate(topics["/twist"][1]):
        if of == "a simulation":
            one.header.stamp.sec, one.header.stamp.nanosec = 5 + k // 100, k % 100 * STEP
        late.append((time + 7_000_000 + k % 3 * 10**6, one))
    topics["/twist"] = topics["/twist"][0], late
    log = open_log(write(tmp_path / "bag", topics))
    twist, plain = log.read(["/twist/twist.linear.x", "/plain/speed"])
    assert np.array_equal(twist.t, np.arange(50) / 100)
    assert np.array_equal(plain.t, np.arange(50) / 100)


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE", "STORAGE"])
def test_compressed_bags_are_read_and_unpack_no_further_than_allowed(mode, tmp_path, monkeypatch):
    topics = {"/velocity": car_topics()["/velocity"]}
    storage = "mcap" if mode == "STORAGE" else "sqlite3"
    compression = getattr(rosbag2.CompressionMode, mode)
    path = write(tmp_path / "bag", topics, storage, compression)
    values = channel_of(open_log(path), "/velocity/longitudinal_velocity").values
    assert np.array_equal(values, np.arange(50.0))
    small = {"FILE": "megabytes=0.001", "MESSAGE": "block=0.00002", "STORAGE": "block=0.001"}
    monkeypatch.setenv("TIREID_LIMITS", small[mode])
    assert "must be at most" in refusal(path) or "cut off" in refusal(path)


@pytest.mark.parametrize(
    "text",
    [
        "!!python/object/apply:os.system ['touch MARK']",
        "rosbag2_bagfile_information: !!python/object/apply:pathlib.Path.touch [MARK]",
        "rosbag2_bagfile_information: [1, 2]", "rosbag2_bagfile_information:\n  version: 5\n",
        "a: &a [x, x]\nb: &b [*a, *a]\nrosbag2_bagfile_information: *b", "[" * 50_000,
        "- " * 50_000, "\n".join(" " * k + "a:" for k in range(200)), "\0",
    ],
)  # fmt: skip
def test_metadata_that_is_hostile_is_refused_and_not_executed(text, tmp_path, drive):
    path = write_bag(tmp_path / "bag", *drive)
    mark = tmp_path / "executed"
    (path / "metadata.yaml").write_text(text.replace("MARK", str(mark)))
    refusal(path)
    assert not mark.exists()


def test_metadata_does_not_lead_out_of_the_folder(tmp_path, drive):
    path = write_bag(tmp_path / "bag", *drive)
    (path / "bag.db3").rename(tmp_path / "bag.db3")
    text = (path / "metadata.yaml").read_text().replace("bag.db3", "../bag.db3")
    (path / "metadata.yaml").write_text(text)
    assert "missing" in refusal(path)


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (
            [
                "CREATE TABLE topics(id, name, type, serialization_format)",
                "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i+1 "
                "FROM n) SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM n",
            ],
            "missing tables",
        ),
        (["CREATE TABLE songs(id, name)"], "is not a ROS 2 bag"),
    ],
    ids=["computes its messages", "of something else"],
)
def test_another_database_is_refused(tables, said, tmp_path):
    path = tmp_path / "bag.db3"
    with sqlite3.connect(path) as base:
        for one in tables:
            base.execute(one)
    base.close()
    assert said in refusal(path)


@pytest.mark.parametrize("storage", STORAGES)
def test_the_rate_of_a_topic_is_that_of_its_messages_however_long_the_bag_is(tmp_path, storage):
    topics = car_topics(400)
    for name, step in (("/twist", 4), ("/plain", 5), ("/velocity", 1)):
        kind, messages = topics[name]
        topics[name] = kind, messages[: 100 if step > 1 else None : step]
    few = {name: topics[name] for name in ("/twist", "/plain", "/velocity")}
    listed = open_log(write(tmp_path / "bag", few, storage)).listed()
    rates = {one.name.split("/")[1]: one.rate for one in listed}
    assert rates == pytest.approx({"twist": 25.0, "plain": 20.0, "velocity": 100.0})


def test_a_bag_of_ros_1_is_refused_with_what_converts_it(tmp_path):
    path = tmp_path / "log.bag"
    path.write_bytes(b"#ROSBAG V2.0\n" + b"\0" * 100)
    assert "is a bag of ROS 1; convert it: rosbags-convert" in refusal(path)


def test_a_type_that_holds_itself_is_refused(tmp_path):
    message = STORE.types["my_msgs/msg/Loop"](1.0)
    path = write(tmp_path / "bag", {"/loop": ("my_msgs/msg/Loop", [(FIRST_NS, message)])})
    with sqlite3.connect(path / "bag.db3") as base:
        base.execute(
            "UPDATE message_definitions SET encoded_message_definition = 'float64 x\nLoop loop\n'"
        )
    base.close()
    assert "types must lie in one another at most 32 deep" in refusal(path)
