"""Where compiled code is kept between runs."""

import os
from pathlib import Path


def cache_folder() -> Path:
    """Return the folder of compiled libraries, which exists afterwards.

    `$TIREID_CACHE` if set, else `$XDG_CACHE_HOME/tireid`, else `~/.cache/tireid`. Its files are
    named by their content, so that it may be deleted at any time.
    """
    chosen = os.environ.get("TIREID_CACHE")
    if chosen:
        folder = Path(chosen)
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tireid"
    folder.mkdir(parents=True, exist_ok=True)
    return folder
