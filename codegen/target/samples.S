/* A recording as it is on disk: rows of the inputs in double. */
    .section .rodata
    .balign 8
    .global recorded_samples
recorded_samples:
    .incbin "samples.bin"
    .global recorded_end
    .balign 8
recorded_end:
#if defined(__linux__)
    .section .note.GNU-stack, "", %progbits
#endif
