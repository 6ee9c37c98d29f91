"""The first bytes by which a file tells its format, whatever its name; no library is needed for it.

What is given here is which reader is asked; it judges the rest of the file.
"""

import re
from pathlib import Path

HEAD = 1 << 12  # bytes that tell a format
GZIP = b"\x1f\x8b"
_PARQUET = b"PAR1"
_MDF = (b"MDF     ", b"UnFinMF ")
_HDF5, _HDF5_PLACES = b"\x89HDF\r\n\x1a\n", (0, 512)  # MATLAB puts a header before
MATLAB, _MATLAB_ORDERS = b"MATLAB", (b"IM", b"MI")
SQLITE, MCAP, ROS1 = b"SQLite format 3\x00", b"\x89MCAP0\r\n", b"#ROSBAG"
BAG_METADATA = "metadata.yaml"  # in the folder of a bag
_NUMPY, _ZIP = b"\x93NUMPY", b"PK\x03\x04"  # an .npz is a ZIP file of .npy
_BLF = b"LOGG"
_FRAMES_IN_TEXT = {
    "ASC": re.compile(
        rb"\s*(?://[^\n]*\n\s*)*date\s[^\n]*\n\s*(?://[^\n]*\n\s*)*base\s+(?:hex|dec)\b", re.I
    ),
    "candump": re.compile(rb"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#"),
    "TRC": re.compile(rb"\s*;\$FILEVERSION="),
    "candump text": re.compile(
        rb"\s*(?:\([\d. :-]+\)\s+)?\w+\s+(?:[RT]X\s[- \w]+)?[0-9A-Fa-f]{3,8}\s+\[\d+\]\s"
    ),
    # SavvyCAN, cabana, python-can: a table of frames, in which an identifier stands beside bytes.
    "CSV": re.compile(
        rb"(?i)(?=[^\n]*(?:\bid\b|\baddr|message_?id|arbitration_id|can_?id))"
        rb"(?=[^\n]*(?:\bdata\b|\bd[01]\b|\bmessage\b|payload))[^\n]*[,;][^\n]*\n"
        rb"[^\n]*[,;][\"' ]*(?:0x)?(?:[0-9a-f]{2}[ ,;]?)+[\"' ,;]*\r?\n"
    ),
}


def is_hdf5(head: bytes) -> bool:
    """Whether a file is HDF5, as MATLAB 7.3 writes it or others do."""
    return any(head[k : k + len(_HDF5)] == _HDF5 for k in _HDF5_PLACES)


def is_numpy(head: bytes) -> bool:
    """Whether a file is an array of NumPy, or an archive of them."""
    return head.startswith(_NUMPY) or (head.startswith(_ZIP) and b".npy" in head[:300])


def is_mat5(head: bytes) -> bool:
    """Whether a file begins as one of MATLAB 5 to 7; those of 7.3 do too, and are HDF5."""
    return head.startswith(MATLAB) and head[126:128] in _MATLAB_ORDERS


def frames_in(head: bytes) -> str:
    """Return which log of frames a file is, "" for none; an MDF file may hold some."""
    if head.startswith(_BLF):
        return "BLF"
    if head.startswith(_MDF):
        return "MDF4"
    return next((name for name, form in _FRAMES_IN_TEXT.items() if form.match(head)), "")


def format_of(path: Path, head: bytes) -> str:
    """Return the reader of a file or folder, as `door._OPENERS` has it, or "folder".
    head : its first bytes, unpacked; none of a folder.
    """
    if path.is_dir():
        return "bag" if (path / BAG_METADATA).is_file() else "folder"
    if head.startswith(_PARQUET) or path.suffix.lower() == ".parquet":
        return "parquet"
    if head.startswith(_MDF):
        return "mdf"
    if is_hdf5(head) or is_mat5(head) or is_numpy(head):
        return "matlab"
    if head.startswith((SQLITE, MCAP, ROS1)):
        return "bag"
    return "can" if frames_in(head) else "text"
