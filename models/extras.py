"""Libraries that only some things need, by the extra of tireid that installs them all."""

EXTRAS = {
    "parquet": ("pyarrow",), "mat": ("h5py",), "mdf": ("asammdf",), "ros": ("rosbags",),
    "can": ("cantools", "python-can"), "onnx": ("onnx", "onnxruntime", "'casadi>=3.8.2'"),
    "live": ("foxglove-sdk", "eclipse-zenoh", "python-can", "cantools"),
    "cluster": ("dask", "distributed"),
    "fleet": ("pyarrow", "dask", "distributed", "fsspec"),
}  # fmt: skip


def needs(what: str, library: str, extra: str) -> str:
    """Return the line that says which library is missing and how to install it."""
    install = f"pip install {' '.join(EXTRAS[extra])}"
    return f"{what} needs {library}: {install} (in a checkout of tireid: pip install '.[{extra}]')"
