/* What is replayed of a tracker: the vectors of the self-test. */
#ifndef REPLAYED_H
#define REPLAYED_H

#include "tireid_mpc.h"
#include "tireid_mpc_params.h"
#include "tireid_mpc_vectors.h"

#ifndef STEPS
#define STEPS VECTORS /* that are taken */
#endif
#define SPOT 1U /* the stack is looked at each so many steps */
#define COUNTS                                                                                     \
    ((uint32_t)TIREID_MPC_ITERATION_LIMIT) /* up to this status, instructions are counted */
#define WORK ((uint64_t)sizeof work)
#define FAULTS 0U

static tireid_mpc_state state; /* in .bss: bytes between its members are zero everywhere */
static tireid_mpc_work work;
static tireid_mpc_params params;
static tireid_mpc_input input;

static void replayed_begin(void)
{
    (void)tireid_mpc_default_params(&params);
    (void)tireid_mpc_init(&state);
}

/* Take the next vector; return whether there is one. */
static int replayed_next(uint32_t k)
{
    uint32_t j;
    if (k == STEPS) {
        return 0;
    }
    input.e_y = (tireid_mpc_real)vector_input[k][0];
    input.e_psi = (tireid_mpc_real)vector_input[k][1];
    input.v_y = (tireid_mpc_real)vector_input[k][2];
    input.r = (tireid_mpc_real)vector_input[k][3];
    for (j = 0U; j <= TIREID_MPC_HORIZON; j++) {
        const uint32_t at = (j == 0U) ? k : (k + VECTOR_OFFSET + (VECTOR_STRIDE * (j - 1U)));
        input.kappa[j] = (tireid_mpc_real)vector_road[at][0];
        input.v_x[j] = (tireid_mpc_real)vector_road[at][1];
    }
    return 1;
}

static uint32_t replayed_step(void)
{
    tireid_mpc_real steering;
    return (uint32_t)tireid_mpc_step(&state, &params, &work, &input, &steering);
}

#endif
