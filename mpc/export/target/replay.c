/* Takes the vectors of the self-test through the tracker; prints a hash of all that came out, and what
 * it cost. */
#include "tireid_mpc.h"
#include "tireid_mpc_params.h"
#include "machine.h"
#include "tireid_mpc_vectors.h"

#ifndef STEPS
#define STEPS VECTORS /* that are taken */
#endif

static tireid_mpc_state state; /* in .bss: bytes between its members are zero everywhere */
static tireid_mpc_work work;
static tireid_mpc_params params;

static uint64_t hash_bytes(uint64_t hash, const void *start, uint32_t size)
{
    const uint8_t *byte = (const uint8_t *)start;
    uint32_t i;
    for (i = 0U; i < size; i++) {
        hash = (hash ^ byte[i]) * 1099511628211U; /* FNV-1a */
    }
    return hash;
}

static void print(const char *key, uint64_t number)
{
    char text[20];
    int i;
    for (i = 15; i >= 0; i--) {
        text[i] = "0123456789abcdef"[number & 15U];
        number >>= 4;
    }
    text[16] = '\n';
    text[17] = '\0';
    machine_print(key);
    machine_print(" ");
    machine_print(text);
}

/* Instructions between two readings of a counter that wraps. */
static uint32_t since(uint32_t before, uint32_t after)
{
    return (after >= before) ? (after - before) : ((after + (0x1000000U * 40U)) - before);
}

static tireid_mpc_input vector(uint32_t k)
{
    tireid_mpc_input input;
    uint32_t j;
    input.e_y = (tireid_mpc_real)vector_input[k][0];
    input.e_psi = (tireid_mpc_real)vector_input[k][1];
    input.v_y = (tireid_mpc_real)vector_input[k][2];
    input.r = (tireid_mpc_real)vector_input[k][3];
    for (j = 0U; j <= TIREID_MPC_HORIZON; j++) {
        const uint32_t at = (j == 0U) ? k : (k + VECTOR_OFFSET + (VECTOR_STRIDE * (j - 1U)));
        input.kappa[j] = (tireid_mpc_real)vector_road[at][0];
        input.v_x[j] = (tireid_mpc_real)vector_road[at][1];
    }
    return input;
}

int main(void)
{
    uint64_t hash = 14695981039346656037U;
    uint64_t total = 0U;
    uint32_t most = 0U;
    uint32_t planned = 0U;
    uint32_t stack = 0U;
    uint32_t k;
    (void)tireid_mpc_default_params(&params);
    (void)tireid_mpc_init(&state);
    machine_start_clock();
    for (k = 0U; k < STEPS; k++) {
        static tireid_mpc_input input;
        tireid_mpc_real steering;
        uint32_t code; /* an enum has not the same size everywhere */
        uint32_t before;
        uint32_t spent;
        input = vector(k);
        machine_paint_stack();
        before = machine_instructions();
        code = (uint32_t)tireid_mpc_step(&state, &params, &work, &input, &steering);
        spent = since(before, machine_instructions());
        if (machine_painted_stack_used() > stack) {
            stack = machine_painted_stack_used();
        }
        if (code <= (uint32_t)TIREID_MPC_ITERATION_LIMIT) {
            total += spent;
            planned++;
        }
        most = (spent > most) ? spent : most;
        hash = hash_bytes(hash, &state, (uint32_t)sizeof state);
        hash = hash_bytes(hash, &code, (uint32_t)sizeof code);
    }
    print("hash", hash);
    print("stack", stack);
    print("steps", k);
    print("instructions", (planned > 0U) ? (total / planned) : 0U);
    print("most_instructions", most);
    print("state", (uint64_t)sizeof state);
    print("params", (uint64_t)sizeof params);
    print("work", (uint64_t)sizeof work);
    return 0;
}
