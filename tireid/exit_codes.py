"""How a command ends, told to the shell."""

DONE = 0
FAILS = 1  # a check that was asked for fails
BAD_INPUT = 2
NOT_VALID = 3  # an answer that is not to be trusted; --accept makes it 0
NOT_TOLD = 74  # EX_IOERR of sysexits.h: all was done, but standard output could not be written
INTERRUPTED = 130
