"""Tire property files as the world writes them, and the lines that say what is wrong with one."""

import re
from math import atan, cos, inf, radians, sin

import pytest

from models.tires import MagicFormula, TirError, read_tir
from tests.refused import line_about

ESSENTIAL = {
    "FNOMIN": "4000", "PCX1": "1.6", "PDX1": "1.1", "PKX1": "22", "PCY1": "1.3", "PDY1": "1.0",
    "PKY1": "-19", "PKY2": "1.9",
}  # fmt: skip
PLAIN = "\n".join(f"{key} = {value}" for key, value in ESSENTIAL.items())


def written(folder, text):
    path = folder / "odd.tir"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def tire_of(folder, text):
    return MagicFormula.from_tir(written(folder, text))


def edited(**changes):
    """A small complete file with values replaced, added, or (None) removed."""
    lines = {**ESSENTIAL, **changes}
    return "\n".join(f"{key} = {value}" for key, value in lines.items() if value is not None)


def complaint(folder, text):
    """The one line about a file, without its path."""
    message = line_about(written(folder, text), TirError, MagicFormula.from_tir)
    assert message.startswith(": ") and issubclass(TirError, ValueError)
    return message[2:]


def test_eight_coefficients_are_a_tire(tmp_path):
    tire = tire_of(tmp_path, PLAIN)
    assert tire.name == "odd"
    assert tire.side == "left"
    assert tire.valid_range.F_z == (-inf, inf)
    assert tire.coefficients.LMUY == 1.0
    assert tire.coefficients.PDY2 == 0.0
    assert tire.forces(0.3, 0.0, 0.0, 4000.0).F_y == pytest.approx(4000.0, rel=0.05)


def test_a_file_of_odd_habits_means_the_same_tire(tmp_path):
    odd = """\ufeff$ file of an unknown program $ with = signs ! in comments
[mdi_header]
 FILE_TYPE='tir'
(COMMENTS)
{comment_string}
'Reifen, Straße $ 5 ! gemessen'
[Units]
Length\t= 'MM'   $ lengths
force = "kN"
ANGLE = 'Degrees' ! not for coefficients
TIME  = 'millisecond'
[MODEL]
property_file_format = 'pac2002' $Tire property type
TYRESIDE = 'Right'
[DIMENSION]
unloaded_radius = 316
[VERTICAL]
fnomin\t=\t4.0   $ kN
VERTICAL_STIFFNESS = .21
[DEFLECTION_LOAD_CURVE]
{pen fz}
0 0.0
10 2.0
[SHAPE]
{radial width}
 1.0    0.0
 0.9    1.0
[INVENTED_SECTION]
HELLO = world and more
PI = 3.14159 is pi
[VERTICAL_FORCE_RANGE]
FZMIN = 0.2
FZMAX = 9
[SLIP_ANGLE_RANGE]
ALPMIN = -10
ALPMAX = 20
[LONGITUDINAL_COEFFICIENTS]
pcx1=+1.6D0$no space
PDX1 = 1.1e+00 !
pkx1 = 2.2d1
[LATERAL_COEFFICIENTS]
PCY1 = 130.E-2
  PDY1 = '1.0'
PKY1 = -19.
PKY2 = 1.9
$ the end, without a line break"""
    plain = tire_of(tmp_path, edited(TYRESIDE="RIGHT", UNLOADED_RADIUS=0.316))
    forms = [
        odd.encode("utf-8"),
        odd.replace("\n", "\r\n").encode("utf-8"),
        odd.replace("\n", "\r").encode("utf-8"),
        odd.removeprefix("\ufeff").encode("latin-1"),
        odd.removeprefix("\ufeff").encode("utf-16"),
    ]
    for form in forms:
        tire = tire_of(tmp_path, form)
        assert tire.coefficients == plain.coefficients
        assert tire.side == "right"
        assert tire.valid_range.F_z == pytest.approx((200.0, 9000.0))
        # the file's α is ISO's, ours the paper's: 20 degrees at one end become -20 at the other
        assert tire.valid_range.alpha == pytest.approx((-radians(20.0), radians(10.0)))
        assert tire.valid_range.gamma == (-inf, inf)
    tir = read_tir(tmp_path / "odd.tir")
    assert tir.number("UNLOADED_RADIUS") == pytest.approx(0.316)
    assert tir.number("VERTICAL_STIFFNESS") == pytest.approx(210e3)
    assert tir.text("HELLO", "") == "world and more"
    assert tir.number("NO_SUCH_KEY") is None
    assert "HELLO" in tir


@pytest.mark.parametrize(
    ("unit", "newton"),
    [
        ("newton", 1.0), ("NEWTONS", 1.0), ("N", 1.0), ("kN", 1000.0), ("kilonewton", 1000.0),
        ("lbf", 4.4482216152605), ("pound_force", 4.4482216152605), ("pound_for", 4.4482216152605),
        ("KGF", 9.80665), ("kilogram_for", 9.80665),
    ],
)  # fmt: skip
def test_loads_come_in_every_unit(tmp_path, unit, newton):
    tire = tire_of(tmp_path, f"[UNITS]\nFORCE = '{unit}'\n{PLAIN}")
    nominal_load = tire.coefficients.FNOMIN
    assert nominal_load == pytest.approx(4000.0 * newton, rel=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "[UNITS] $ here\nFORCE = 'newton'\n[INERTIA]\nFORCE = 9.3\nMASS = 7",
        "[INERTIA]\nFORCE and MASS as weighed",
    ],
)
def test_a_key_or_word_like_a_unit_is_none_outside_its_section(tmp_path, text):
    tire = tire_of(tmp_path, f"{text}\n{PLAIN}")
    assert tire.coefficients.FNOMIN == 4000.0


def test_files_of_the_same_formula_are_accepted(tmp_path):
    for head in (
        "PROPERTY_FILE_FORMAT = 'PAC2002'",
        "PROPERTY_FILE_FORMAT = 'USER'\nFITTYP = 6",
        "PROPERTY_FILE_FORMAT = 'MF-TYRE'\nFITTYP = 52",
        "PROPERTY_FILE_FORMAT = 'MF52'",
        "PROPERTY_FILE_FORMAT = 'MF_05'\nFITTYP = 5",
        "PROPERTY_FILE_FORMAT = 'MF-TYRE'\nFITTYP = 5",
        "FITTYP = 21",
    ):
        tire = tire_of(tmp_path, f"{head}\n{PLAIN}")
        assert tire.coefficients == tire_of(tmp_path, PLAIN).coefficients


@pytest.mark.parametrize(
    ("head", "says"),
    [
        ("FITTYP = 61", "Magic Formula 6.x"),
        ("PROPERTY_FILE_FORMAT = 'MF-TYRE'\nFITTYP = 62", "Magic Formula 6.x"),
        ("FITTYP = 3", "unknown model"),
        ("PROPERTY_FILE_FORMAT = 'MF-SWIFT'\nFITTYP = 21", "MF-SWIFT"),
        ("PROPERTY_FILE_FORMAT = 'PAC89'", "PAC89"),
        ("PROPERTY_FILE_FORMAT = 'FTIRE'", "FTIRE"),
        ("PROPERTY_FILE_FORMAT = 'MF_05'\nFITTYP = 61", "Magic Formula 6.x"),
        ("PROPERTY_FILE_FORMAT = 'MF_94'", "only PAC2002, MF_05 and MF 5.2"),
        ("PKY4 = 2.0", "PKY4 = 2 belong to Magic Formula 6.x"),
    ],
)
def test_other_models_are_refused_because_their_equations_differ(tmp_path, head, says):
    assert says in complaint(tmp_path, f"{head}\n{PLAIN}")


@pytest.mark.parametrize(
    ("label", "called"),
    [
        ("PROPERTY_FILE_FORMAT = 'PAC2002'", "it calls itself PAC2002"),
        ("PROPERTY_FILE_FORMAT = 'USER'\nFITTYP = 6", "it calls itself USER, FITTYP 6"),
        ("PROPERTY_FILE_FORMAT = 'MF_05'\nFITTYP = 5", "it calls itself MF_05, FITTYP 5"),
        ("FITTYP = 21", "it has no PROPERTY_FILE_FORMAT, FITTYP 21"),
    ],
)
@pytest.mark.parametrize(
    "mark",
    [
        "PKY4 = 2", "PKY6 = -0.9", "PEY5 = -28.4", "PPY5 = -0.6", "RBY4 = 3", "PCY2 = 0.8",
        "NOMPRES = 220000", "INFLPRES = 2.2D5",
    ],
)  # fmt: skip
def test_a_file_of_another_version_is_told_by_its_coefficients_whatever_it_calls_itself(
    tmp_path, label, called, mark
):
    message = complaint(tmp_path, f"{label}\n{PLAIN}\n{mark}")
    assert message.startswith(mark.split(" = ")[0] + " = ")
    assert "Magic Formula 6.x or MF-MCTyre, whose equations differ" in message
    assert called in message


def test_the_pressure_coefficients_of_pac2002_are_no_mark_of_another_version(tmp_path):
    """PPX1-4 and PPY1-4 beside IP and IP_NOM are PAC2002's own; only PPY5 is not."""
    own = edited(IP="2", IP_NOM="2", PPX1="0.5", PPY1="-0.4", PPY4="0.1")
    tire_of(tmp_path, f"PROPERTY_FILE_FORMAT = 'PAC2002'\n{own}")


def test_a_file_of_the_formula_that_lists_later_names_too_is_read(tmp_path):
    """PHY3 is what later versions dropped; PKY4 = 2 and equal pressures change no equation."""
    own = edited(PHY3="0.02", PPY1="-0.4")
    later = "PKY4 = 2\nPKY5 = 0\nPEY5 = 0\nNOMPRES = 80000\nINFLPRES = 80000"
    for label in (
        "PROPERTY_FILE_FORMAT = 'MF-TYRE'\nFITTYP = 52",
        "PROPERTY_FILE_FORMAT = 'MF_05'",
    ):
        plain = tire_of(tmp_path, f"{label}\n{own}").coefficients
        listed = written(tmp_path, f"{label}\n{own}\n{later}")
        assert MagicFormula.from_tir(listed).coefficients == plain
        for mark in ("PKY4 = 1.9", "PKY6 = -0.9"):
            assert mark in complaint(tmp_path, f"{label}\n{own}\nNOMPRES = 80000\n{mark}")
    assert "PKY4 = 2" in complaint(tmp_path, f"{own}\n{later}")


def test_pressures_by_their_later_names_scale_as_those_of_pac2002(tmp_path):
    label = "PROPERTY_FILE_FORMAT = 'MF_05'\n"
    effects = {"PHY3": "0.02", "PPY1": "-0.4", "PPY3": "-1"}
    now, nominal = "220000", "200000"
    later = label + edited(**effects, INFLPRES=now, NOMPRES=nominal)
    own = label + edited(**effects, IP=now, IP_NOM=nominal)
    read = tire_of(tmp_path, later).coefficients
    mu = read.PDY1
    assert mu == pytest.approx(0.9)
    assert read == tire_of(tmp_path, own).coefficients
    says = complaint(tmp_path, label + edited(**effects, INFLPRES="0", NOMPRES=nominal))
    assert says == "INFLPRES and NOMPRES must be positive, they are 0 and 200000"


def test_a_negative_lateral_friction_is_the_same_tire(tmp_path):
    """B = K/(C D) takes the sign of D, and D sin(C atan(B x)) is the same in (-B, -D)."""
    values = {"PDY1": -0.71, "PDY2": 0.14, "PDY3": -4.5, "PHY1": 0.005, "PVY1": 0.014, "RVY1": 0.2}
    values |= {"RVY4": 12.0, "RVY5": 1.9, "RVY6": -10.0, "RBY1": 7.0, "RBY2": 2.0, "RCY1": 1.0}
    tire = tire_of(tmp_path, edited(**{k: str(values[k]) for k in values}))
    F_z, alpha, kappa, gamma = 5000.0, -0.06, -0.04, 0.03  # ISO slip angle
    df = (F_z - 4000.0) / 4000.0
    D = F_z * (values["PDY1"] + values["PDY2"] * df) * (1.0 - values["PDY3"] * gamma**2)
    K = -19.0 * 4000.0 * sin(2.0 * atan(F_z / (1.9 * 4000.0)))
    F_0 = D * sin(1.3 * atan(K / (1.3 * D) * (alpha + 0.005))) + F_z * 0.014
    G = cos(atan(7.0 * cos(atan(2.0 * alpha)) * kappa))
    S = D * 0.2 * cos(atan(12.0 * alpha)) * sin(1.9 * atan(-10.0 * kappa))
    assert tire.forces(-alpha, kappa, gamma, F_z).F_y == pytest.approx(G * F_0 + S, rel=1e-6)
    assert tire.cornering_stiffness(F_z) > 0.0


def test_all_missing_coefficients_are_named_at_once(tmp_path):
    message = complaint(tmp_path, edited(PCY1=None, PKX1=None, FNOMIN=None))
    assert message.startswith("lacks FNOMIN, PKX1, PCY1")
    assert message.count("P") >= 2
    assert "lacks FNOMIN, PCX1, PDX1, PKX1, PCY1, PDY1, PKY1, PKY2" in complaint(tmp_path, "")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"FNOMIN": "0"}, "FNOMIN must be positive, it is 0"),
        ({"FNOMIN": "-4000"}, "FNOMIN must be positive"),
        ({"PCY1": "-1.3"}, "PCY1 must be positive"),
        ({"PCX1": "0"}, "PCX1 must be positive"),
        ({"PKY1": "19"}, "PKY1 must be negative"),
        ({"PKY2": "0"}, "PKY2 must be positive"),
        ({"LMUY": "0"}, "LMUY must be positive"),
        ({"LFZO": "-1"}, "LFZO must be positive"),
        ({"FZMIN": "900", "FZMAX": "100"}, "FZMIN must be below FZMAX"),
        ({"KPUMIN": "1", "KPUMAX": "1"}, "KPUMIN must be below KPUMAX"),
        ({"TYRESIDE": "'RIGTH'"}, "TYRESIDE must be"),
        ({"IP": "-1", "IP_NOM": "2"}, "IP and IP_NOM must be positive"),
        ({"IP": "2", "IP_NOM": "1", "PPX3": "-1.5"}, "at its inflation pressure PDX1 must be"),
    ],
)
def test_impossible_values_are_refused(tmp_path, change, says):
    assert says in complaint(tmp_path, edited(**change))


@pytest.mark.parametrize("word", ["abc", "1,3", "nan", "inf", "1e999", "1.3 1.4", "1_0", "", "'x'"])
def test_a_value_that_is_no_number_is_shown_with_its_line(tmp_path, word):
    message = complaint(tmp_path, f"{PLAIN}\n\nPHY1 = {word}\n")
    assert re.match(r"line 10: PHY1 must be a finite number, it is ", message)
    tire_of(tmp_path, f"{PLAIN}\nNOBODY_NEEDS_IT = {word}\n")


@pytest.mark.parametrize(
    ("key", "lines"),
    [
        ("PCY1", "PCY1 = 1.4"),
        ("TYRESIDE", "TYRESIDE = 'LEFT'\n[MODEL]\nTYRESIDE = 'RIGHT'"),
        (
            "PROPERTY_FILE_FORMAT",
            "PROPERTY_FILE_FORMAT = 'FTIRE'\n\nPROPERTY_FILE_FORMAT = 'PAC2002'",
        ),
        ("FORCE", "[UNITS]\nFORCE = 'newton'\n[MODEL]\nFORCE = 9\n[UNITS]\nFORCE = 'kN'"),
    ],
)
def test_two_lines_that_disagree_are_refused(tmp_path, key, lines):
    assert f"{key} has different values in lines " in complaint(tmp_path, f"{lines}\n{PLAIN}")


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("phy1 0.003", 'line 1: PHY1 has no "="'),
        ("TYRESIDE 'RIGHT'", 'line 1: TYRESIDE has no "="'),
        ("PROPERTY_FILE_FORMAT: 'FTIRE'", 'line 1: PROPERTY_FILE_FORMAT has no "="'),
        ("[UNITS]\nFORCE 'kN'", 'line 2: FORCE has no "="'),
    ],
)
def test_a_forgotten_equals_sign_is_no_missing_word(tmp_path, line, says):
    assert says in complaint(tmp_path, f"{line}\n{PLAIN}")


@pytest.mark.parametrize(
    "sign", [b"\x85", "\u0085".encode(), "\u2028".encode(), b"\x0b", b"\x0c", b"\x1c"]
)
def test_a_comment_ends_with_its_line_alone(tmp_path, sign):
    """0x85 is the ellipsis of cp1252, and the next line of Unicode."""
    raw = PLAIN.encode() + b"\n$ measured on wet road " + sign + b"LMUY = 0.5\n"
    assert tire_of(tmp_path, raw).coefficients.LMUY == 1.0


def test_a_symmetric_tire_loses_conicity_and_plysteer(tmp_path):
    lopsided = {"PHY1": "0.01", "PVY1": "0.02"}
    plain = tire_of(tmp_path, edited(**lopsided))
    tire = tire_of(tmp_path, edited(**lopsided, TYRESIDE="SYMMETRIC"))
    assert plain.forces(0.0, 0.0, 0.0, 4000.0).F_y != 0.0
    assert tire.forces(0.0, 0.0, 0.0, 4000.0).F_y == 0.0


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(TirError, match=r"nowhere\.tir: there is no such file"):
        MagicFormula.from_tir(tmp_path / "nowhere.tir")


@pytest.mark.parametrize("raw", [b"\x00\x01\x02\xff" * 100, b"", b"\xff\xfe\x00", b"PK\x03\x04"])
def test_a_file_that_is_no_text_is_a_tire_error(tmp_path, raw):
    assert complaint(tmp_path, raw).startswith("lacks FNOMIN")


def test_inflation_pressure_scales_friction_alike_at_every_load(tmp_path):
    """All of a friction, PD1 + PD2 df_z, is scaled: the peak keeps its ratio at any load."""
    spread = {"PDX2": "-0.3", "PDY2": "-0.2", "PKX2": "3"}
    pressure = {"IP": "220000", "IP_NOM": "200000", "LIP": "1.5"}
    effects = {"PPX3": "0.5", "PPY3": "-0.4", "PPY4": "1", "PPX1": "0.6"}
    plain = tire_of(tmp_path, edited(**spread))
    blown = tire_of(tmp_path, edited(**spread, **pressure, **effects))
    dp = (1.5 * 220.0 - 200.0) / 200.0
    slips = [0.002 * k for k in range(1, 400)]
    for F_z in (2000.0, 4000.0, 7000.0):
        peaks = [
            (
                max(tire.forces(0.0, kappa, 0.0, F_z).F_x for kappa in slips),
                max(tire.forces(alpha, 0.0, 0.0, F_z).F_y for alpha in slips),
            )
            for tire in (plain, blown)
        ]
        assert peaks[1][0] / peaks[0][0] == pytest.approx(1.0 + 0.5 * dp, rel=1e-3)
        assert peaks[1][1] / peaks[0][1] == pytest.approx(1.0 - 0.4 * dp + dp**2, rel=1e-3)
        stiffness = [tire.forces(0.0, 1e-6, 0.0, F_z).F_x for tire in (plain, blown)]
        assert stiffness[1] / stiffness[0] == pytest.approx(1.0 + 0.6 * dp, rel=1e-4)


def test_a_scale_that_is_not_written_is_one_and_a_coefficient_zero(tmp_path):
    """Conditions of the format: what a file leaves out changes nothing."""
    bare = tire_of(tmp_path, PLAIN).coefficients
    for name in bare.__dataclass_fields__:
        if name not in ESSENTIAL:
            assert getattr(bare, name) == (1.0 if name.startswith("L") else 0.0), name


def test_every_size_of_a_tire_is_read_in_the_unit_of_its_kind(tmp_path):
    units = "LENGTH = 'mm'\nFORCE = 'kN'\nANGLE = 'deg'\nTIME = 'min'\nMASS = 'g'"
    expected = {
        "FNOMIN": 1e3, "FZMIN": 1e3, "FZMAX": 1e3,
        "UNLOADED_RADIUS": 1e-3, "WIDTH": 1e-3, "RIM_RADIUS": 1e-3, "RIM_WIDTH": 1e-3,
        "ALPMIN": radians(1.0), "CAMMAX": radians(1.0), "LONGVL": 1e-3 / 60.0,
        "VXLOW": 1e-3 / 60.0, "VERTICAL_STIFFNESS": 1e6, "VERTICAL_DAMPING": 6e7, "MBELT": 1e-3,
    }  # fmt: skip
    lines = "\n".join(f"{key} = 2" for key in expected)
    tir = read_tir(written(tmp_path, f"[UNITS]\n{units}\n[MODEL]\n{lines}\n"))
    for key, one in expected.items():
        assert tir.number(key) == pytest.approx(2.0 * one), key
