"""The commands of tireid, in the order in which a person meets them."""

from tireid import (
    check_command,
    compare_command,
    demo_command,
    drive_command,
    export_command,
    identify_command,
    paper_command,
)

COMMANDS = (
    demo_command,
    paper_command,
    identify_command,
    compare_command,
    check_command,
    export_command,
    drive_command,
)
