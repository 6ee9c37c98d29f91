/* What is replayed of an identifier: a recording, sample by sample. */
#ifndef REPLAYED_H
#define REPLAYED_H

#include "tireid.h"

#define SPOT 16U /* the stack is looked at each so many steps */
#define COUNTS                                                                                     \
    ((uint32_t)TIREID_OK) /* instructions of steps with a status up to this are counted */
#define WORK 0U
#define FAULTS state.faults
#define INPUTS (sizeof(tireid_input) / sizeof(tireid_real))

typedef struct {
    double value[INPUTS];
} sample;

extern const sample recorded_samples[];
extern const sample recorded_end[];

static tireid_state state; /* in .bss: bytes between its members are zero everywhere */
static tireid_params params;
static tireid_input input;

static void replayed_begin(void)
{
    (void)tireid_default_params(&params);
    (void)tireid_init(&state);
}

/* Take the next sample, in the precision of the package; return whether there is one. */
static int replayed_next(uint32_t k)
{
    union {
        tireid_real number[INPUTS];
        tireid_input input;
    } both;
    const sample *at = &recorded_samples[k];
    uint32_t i;
    if (at == recorded_end) {
        return 0;
    }
    for (i = 0U; i < INPUTS; i++) {
        both.number[i] = (tireid_real)at->value[i];
    }
    input = both.input;
    return 1;
}

static uint32_t replayed_step(void)
{
    return (uint32_t)tireid_step(&state, &params, &input);
}

#endif
