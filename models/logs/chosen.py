"""Numbers that were chosen here, file by file, with their units and reasons."""

from typing import NamedTuple


class Chosen(NamedTuple):
    """Numbers of this package, by the file that reads them."""

    # axes
    step: float = 0.1  # [s] between instants
    axes_window: float = 0.3  # [s] over which means are taken there
    most: int = 20_000  # instants
    slow: float = 3.0  # [m/s]: slower samples tell nothing
    axes_clear: float = 3.0  # times that the speed is larger than what is measured across it
    axes_sure: float = 0.7  # correlation from which axes are known
    likely: float = 0.4  # correlation from which their signs are known
    axes_near: float = 0.25  # share of gravity by which a mean of it may be off
    tilt: float = 0.4  # share of it along another axis from which a box lies oblique
    # bag
    ns: float = 1e9  # in a second
    # seconds between stamps and the bag's own time, above which these differ
    other_clock: int = 3600
    probed_messages: int = 20  # messages that a rate is taken from
    messages_at_once: int = 2048  # messages that are read at a time
    most_bytes: int = 1 << 24  # of messages that are read at a time, at most
    # can
    frames_at_once: int = 1 << 16  # frames that are stored at a time
    short: int = 0x7FF  # largest identifier of 11 bits
    identifier: int = (1 << 29) - 1  # mask of the 29 bits of the longest identifier
    inflation: int = 1032  # most bytes that deflate makes of one
    container: int = 10  # kind of an object of a BLF that holds others
    deflated: int = 2  # way in which one is packed that is read: by zlib
    from_all: int = 0xFE  # address that a database of J1939 gives where any may send
    floats: tuple[int, int, int] = (16, 32, 64)  # bits of a signal that is a float
    longest_signal: int = 64  # bits
    # cdr
    prefix: int = 4  # bytes
    base: int = 1  # kind of a node of a definition: a number or text
    name: int = 2  # likewise: another definition
    array: int = 3  # likewise: of a fixed length
    sequence: int = 4  # likewise: of any length
    # clock
    longest_gap: float = 0.1  # [s]
    # own intervals of a channel, more of which without a sample are a gap
    gap_intervals: float = 2.5
    slowest_channel: float = 0.11  # [s]: longest typical interval of a channel, 10 Hz with jitter
    # share of empty cells from which a channel is taken to be slower than its rows
    own_clock: float = 0.4
    on_step: float = 0.01  # share of a step within which an instant is that of a sample
    # hdf5
    longest_text: int = 1_000_000  # bytes of all texts of a dataset
    most_texts: int = 10_000  # of a dataset
    # log
    some: int = 12  # names in a message
    longest: int = 200  # characters of them
    # mdf
    formula_4: int = 3  # kind of conversion of MDF 4 that is a formula
    formula_3: int = 10  # the same of MDF 3
    values: tuple[int, int] = (0, 6)  # types of a channel that holds numbers
    time: int = 1  # type of a master that counts seconds
    numbers_at_once: int = 1 << 23  # numbers that are read at a time
    probed_samples: int = 200  # samples of a clock that its rate is taken from
    most_blocks: int = 1_000_000  # of data
    bus_event: int = 1 << 1  # flag of a group of channels that holds frames of a bus
    # names
    names_sure: float = 0.8  # confidence from which a proposal is used without being declared
    standard: float = 1.0  # confidence in our own name of a channel
    known: float = 0.95  # confidence in the name that a logger gives
    words: float = 0.9  # confidence in the words of a name
    vague: float = 0.82  # confidence in one such word
    hint: float = 0.5  # a word of the name beside a unit that fits: named, never taken
    no_unit_loss: float = 0.25  # of confidence, where neither file nor name tells the unit
    filtered_loss: float = 0.08  # of confidence, so that the channel that was filtered stands back
    still: float = 0.25  # of confidence that is left to a channel that never changes
    apart: float = 0.04  # of confidence: nearer ones are equal
    largest_road: float = 1.2  # [rad]: an angle that goes further is that of a hand wheel
    looked_at: int = 20_000  # samples at most, in telling contents apart
    spikes: float = 1e-3  # share of samples that say nothing of the unit
    same: float = 2e-3  # of their size: by less two channels differ that are one, but for rounding
    # parquet
    head: int = 400  # rows that tell what columns are
    batch: int = 1 << 16  # rows that are read at once
    # preamble
    rows: int = 400  # of data that tell what columns are
    tail: int = 40  # last lines of them that tell how cells are written
    many: int = 300  # cells of a line that tell how all are written
    preamble_clear: float = 0.9  # share of cells that a way of reading must make numbers to be sure
    rates: tuple[float, float] = (1.0, 1e5)  # [Hz], least and most
    longest_instant: int = 60  # characters
    # stamps
    calendar: float = 1e8  # [s]: times above count from 1970
    fastest: float = 1e-5  # [s] between samples of a car's log, at least
    slowest: float = 0.11  # [s] between samples of a car's log, at most
    coarsest: float = 1.0  # [s] between stamps without a unit: more than that are no seconds
    worth: float = 0.05  # share of a step by which rounding must shift stamps to be taken out
    most_steps: int = 100_000  # samples that a rate is taken from
    # samples that share a stamp, on average: with fewer they are doubled, not rounded
    shared: float = 1.2
    jitter: float = 1.2  # steps that stamps of an even clock may lie apart
    averaged: int = 50  # samples of a mean over such stamps
    pause: float = 10.0  # [s] before a clock that starts again: a gap, which cuts the log
    back: float = 1.0  # [s] that a clock goes back: less is a sample astray
    fewest: int = 10  # samples that go on from there: fewer are astray
    repeated: float = 0.2  # share of stamps of a column that repeat, of which another may be finer
    other_rate: float = 0.2  # share of a step by which that of another clock differs
    same_drive: float = 60.0  # [s] between the beginnings of two clocks of one drive, at most
    # table
    long: int = 8  # columns at most of a table with a row for each value
    most_words: int = 10_000  # names of runs in one log
    # text
    block: int = 1 << 22  # bytes of text that pyarrow reads at once
    small_block: int = 1 << 19  # bytes of text that Python reads at once
    quotes: int = 8  # that may stand before the end of a block and not close
    largest_line: int = 1 << 23  # bytes: 10 000 columns of 800
    # tree
    least_rate: float = 1.0  # [Hz]
    most_rate: float = 1e5  # [Hz]
    most_columns: int = 1000  # of a matrix that is a table of signals


CHOSEN = Chosen()
